#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/volume.h"

namespace tomofield::simulate {

/// A solid or hollow ellipsoid. Its density is added to that of other bodies at its place.
///
/// Lengths are voxels. Positions are (X, Y, Z) relative to the centre of the volume: X across the
/// tilt axis, Y along it, Z towards the source at zero tilt. With p = position − center, the outer
/// surface is pᵀ Q p = 1. The inner surface is the outer one scaled by `ratio`.
struct Ellipsoid {
  std::array<double, 3> center{};
  std::array<double, 6> q{};    ///< Qxx Qyy Qzz Qxy Qxz Qyz, Q positive definite
  double radius = 0.0;          ///< of a sphere about the centre that holds the ellipsoid
  double ratio = 0.0;           ///< inner / outer surface, 0 for a solid body
  double wall_density = 0.0;    ///< added between the two surfaces
  double inside_density = 0.0;  ///< added within the inner surface

  /// Returns the largest distance from the centre at which the ellipsoid has a density.
  double reach() const { return radius; }

  /// Returns pᵀ Q p of an offset p from the centre. It is below 1 inside the outer surface.
  double form(double dx, double dy, double dz) const {
    return q[0] * dx * dx + q[1] * dy * dy + q[2] * dz * dz +
           2.0 * (q[3] * dx * dy + q[4] * dx * dz + q[5] * dy * dz);
  }

  /// Returns the density that the ellipsoid adds at an offset from its centre.
  double density(double dx, double dy, double dz) const {
    const double e = form(dx, dy, dz);
    if (e < ratio * ratio) return inside_density;
    return e < 1.0 ? wall_density : 0.0;
  }
};

/// Makes a solid sphere, such as a gold bead.
inline Ellipsoid make_sphere(const std::array<double, 3>& center, double radius, double density) {
  const double s = 1.0 / (radius * radius);
  return {.center = center,
          .q = {s, s, s, 0.0, 0.0, 0.0},
          .radius = radius,
          .ratio = 0.0,
          .wall_density = density,
          .inside_density = density};
}

/// Makes a solid ellipsoid whose semi-axes lie along X, Y and Z.
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

/// A Gaussian blob. At a distance r from its centre it adds peak · exp(−r² / 2σ²) to the density.
/// Lengths and positions are those of Ellipsoid.
struct Blob {
  std::array<double, 3> center{};
  double sigma = 1.0;
  double peak = 0.0;  ///< of either sign

  /// Returns the distance along an axis from which on the blob is left out of images and volumes.
  /// Its density there is below 1.6e-8 of the peak, less than the rounding error of a float.
  double reach() const { return 6.0 * sigma; }

  /// Returns the density that the blob adds at an offset from its centre.
  double density(double dx, double dy, double dz) const {
    return peak * std::exp(-0.5 * (dx * dx + dy * dy + dz * dz) / (sigma * sigma));
  }
};

/// A slab of constant density with ellipsoids and blobs added to it. project_phantom.h computes
/// its exact projections, rasterize.h its voxels.
struct Phantom {
  base::Shape3 shape;             ///< voxels of the truth: field of view × thickness
  bool is_extended = false;       ///< the slab has no end in X and Y
  double half_width_px = 0.0;     ///< ellipsoids lie within |X| <= this
  double slab_density = 0.0;      ///< bounded: within `shape`; extended: within |Z| <= nz / 2
  std::vector<Ellipsoid> bodies;  ///< the specimen's ellipsoids, then the gold beads
  std::int64_t num_beads = 0;     ///< number of gold beads, which are the last of `bodies`
  std::vector<Blob> blobs;        ///< cut off at the faces |Z| = nz / 2 of the slab
};

/// Returns the phantom without its gold beads.
Phantom without_beads(Phantom phantom);

/// The contents of a slab.
enum class Content {
  kHollowEllipsoids,  ///< hollow ellipsoids of constant densities
  kTextured,          ///< what textured_content.h places, in an extended slab only
  kCryo,              ///< what cryo/specimen.h places, in an extended slab only
};

/// Sets the phantom of make_cell_phantom().
struct CellOptions {
  Content content = Content::kHollowEllipsoids;
  std::int64_t size_px = 256;       ///< width and height of the field of view
  std::int64_t thickness_px = 150;  ///< of the slab
  bool is_extended = false;
  double max_tilt_deg = 70.0;  ///< largest |tilt| at which an extended phantom fills the views
  std::uint64_t seed = 7;
  std::int64_t num_beads = 0;  ///< gold beads in the field of view (mean, if extended)
  double bead_diameter_px = 10.0;
  double bead_density = 5.0;  ///< added to that of the cell, which is in [0, 1]
};

/// Makes the slab of a phantom without content.
Phantom make_slab(const CellOptions& options);

/// Adds gold beads to a phantom that has none. Throws Error if they do not fit.
void add_beads(const CellOptions& options, Phantom& phantom);

/// Makes a phantom of the yardsticks A, B and C, which all scores of the project refer to.
/// textured_content.h has the recipe of textured content. The other one is after Kniesel et al.
/// 2022: ice with hollow ellipsoids that have a membrane and do not overlap. U(a, b) is a uniform
/// random number.
///
///   slab density                            0.2
///   semi-axes of an ellipsoid of radius R   one is R, the others U(0.7 R, R)
///   orientation                             uniform
///   ratio of inner to outer surface         U(0.85, 0.95)
///   density of the wall                     0.2 + U(0.5, 0.98)
///   density inside                          0.2 + U(0.1, 0.5)
///
/// For a thickness T, it tries 125 ellipsoids with R = U(0.15, 0.4) T, then 2000 with
/// R = U(0.05, 0.25) T, each lot from the largest to the smallest. It drops an ellipsoid whose
/// bounding sphere would touch an earlier one. All densities are divided by 1.18, the largest sum,
/// so that the cell lies in [0, 1]. A bounded phantom lies within its box. An extended one goes on
/// in X as far as any ray up to max_tilt_deg reaches, and beyond the field of view in Y; it has
/// more tries in proportion.
///
/// With either content, beads are solid spheres that do not touch each other: a third on each face
/// of the slab and a third inside it. They have a random stream of their own, so a seed gives the
/// same cell with and without beads. Throws Error if the beads do not fit.
Phantom make_cell_phantom(const CellOptions& options);

}  // namespace tomofield::simulate
