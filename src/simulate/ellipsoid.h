#pragma once

#include <array>
#include <cmath>

namespace tomofield::simulate {

/// A solid or hollow ellipsoid, to be added to whatever else is at its place.
///
/// Lengths are voxels, positions are (X, Y, Z) relative to the geometric centre
/// of the volume, the frame of CONVENTIONS: X across the tilt axis, Y along it,
/// Z towards the source at zero tilt. The outer surface is pᵀ Q p = 1 for
/// p = position − center, the inner one the same surface scaled by `ratio`.
struct Ellipsoid {
  std::array<double, 3> center{};
  std::array<double, 6> q{};    ///< Qxx Qyy Qzz Qxy Qxz Qyz, Q positive definite
  double radius = 0.0;          ///< of a sphere about the centre that holds all of it
  double ratio = 0.0;           ///< inner / outer surface, 0 for a solid body
  double wall_density = 0.0;    ///< added between the two surfaces
  double inside_density = 0.0;  ///< added within the inner surface

  /// pᵀ Q p of an offset p from the centre: below 1 inside the outer surface.
  double form(double dx, double dy, double dz) const {
    return q[0] * dx * dx + q[1] * dy * dy + q[2] * dz * dz +
           2.0 * (q[3] * dx * dy + q[4] * dx * dz + q[5] * dy * dz);
  }

  /// Density that the ellipsoid adds at an offset from its centre.
  double density(double dx, double dy, double dz) const {
    const double e = form(dx, dy, dz);
    if (e < ratio * ratio) return inside_density;
    return e < 1.0 ? wall_density : 0.0;
  }
};

/// A solid sphere: a gold bead, or the simplest phantom of a test.
inline Ellipsoid make_sphere(const std::array<double, 3>& center, double radius, double density) {
  const double s = 1.0 / (radius * radius);
  return {.center = center,
          .q = {s, s, s, 0.0, 0.0, 0.0},
          .radius = radius,
          .ratio = 0.0,
          .wall_density = density,
          .inside_density = density};
}

/// A solid ellipsoid whose semi-axes lie along X, Y and Z.
inline Ellipsoid make_aligned_ellipsoid(const std::array<double, 3>& center,
                                        const std::array<double, 3>& semi_axes, double density) {
  const auto& a = semi_axes;
  return {.center = center,
          .q = {1.0 / (a[0] * a[0]), 1.0 / (a[1] * a[1]), 1.0 / (a[2] * a[2]), 0.0, 0.0, 0.0},
          .radius = std::fmax(a[0], std::fmax(a[1], a[2])),
          .ratio = 0.0,
          .wall_density = density,
          .inside_density = density};
}

}  // namespace tomofield::simulate
