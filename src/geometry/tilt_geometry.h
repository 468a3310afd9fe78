#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::geometry {

/// A rectangle of the aligned view at zero tilt, in pixels: [x0, x1) × [y0, y1).
struct Roi {
  std::int64_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  std::int64_t width() const { return x1 - x0; }
  std::int64_t height() const { return y1 - y0; }
  bool operator==(const Roi&) const = default;
};

/// Single-axis tilt geometry: the one place that owns centres, hand and
/// rotation. Everything is in pixels of the aligned, binned view; pixel i
/// covers [i, i + 1), its centre is i + 0.5. The specimen's X, Y are the
/// detector's at zero tilt, Z runs over [0, thickness) towards the source.
///
///   x − axis_x = (X − axis_x) cos θ + hand (Z − axis_z) sin θ,    y = Y
///
/// With hand +1 this is the right-handed rotation about +Y of IMOD, AreTomo
/// and RELION (CONVENTIONS); with −1 the volume comes out mirrored in Z.
struct TiltGeometry {
  std::int64_t width = 0, height = 0;  ///< of a view
  double thickness = 0;
  std::vector<double> tilt_deg;
  int hand = 1;
  double axis_x = 0;  ///< where the tilt axis meets the view; the geometric centre is width / 2
  double axis_z = 0;  ///< and the volume; the geometric centre is thickness / 2

  int num_views() const { return static_cast<int>(tilt_deg.size()); }
  double cos_tilt(int view) const;
  /// hand · sin θ: the factor of Z everywhere.
  double signed_sin_tilt(int view) const;
  /// Detector x of a specimen point.
  double detector_x(int view, double x, double z) const;
  /// Specimen X where the ray of detector coordinate u crosses height Z; needs |cos θ| > 0.
  double ray_x(int view, double u, double z) const;
  /// Specimen Z where it crosses X; needs |sin θ| > 0.
  double ray_z(int view, double u, double x) const;
  /// Up to 45° rays cross the rows z = const more steeply than the columns x = const.
  bool is_flat(int view) const;

  /// Smallest and largest X that any ray of any view reaches inside the slab.
  struct Extent {
    double low, high;
  };
  Extent reach() const;
};

/// Geometry about the geometric centres.
TiltGeometry centred_geometry(std::int64_t width, std::int64_t height, double thickness,
                              std::vector<double> tilt_deg);

}  // namespace tomofield::geometry
