#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::geometry {

/// A single-axis tilt geometry. This type alone owns the centres, the hand and the rotation.
/// Coordinates are pixels of the aligned, binned view; pixel i covers [i, i + 1) and its centre is
/// i + 0.5. The specimen's X and Y are those of the detector at zero tilt; Z runs over
/// [0, thickness) towards the source.
///
///   x − axis_x = (X − axis_x) cos θ + hand (Z − axis_z) sin θ,    y = Y
///
/// hand +1 is the right-handed rotation about +Y of IMOD, AreTomo and RELION (docs/geometry.md);
/// with −1 the volume comes out mirrored in Z.
struct TiltGeometry {
  std::int64_t width = 0, height = 0;  ///< size of a view in pixels
  double thickness = 0;                ///< thickness of the specimen in pixels
  std::vector<double> tilt_deg;
  int hand = 1;
  double axis_x = 0;  ///< x of the tilt axis in the view; width / 2 is the geometric centre
  double axis_z = 0;  ///< z of the tilt axis in the volume; thickness / 2 is the geometric centre

  int num_views() const { return static_cast<int>(tilt_deg.size()); }
  double cos_tilt(int view) const;
  /// Returns hand · sin θ, the factor of Z in the projection.
  double signed_sin_tilt(int view) const;
  /// Returns the detector x of a specimen point.
  double detector_x(int view, double x, double z) const;
  /// Returns the specimen X where the ray of detector coordinate u crosses height Z; needs
  /// |cos θ| > 0.
  double ray_x(int view, double u, double z) const;
  /// Returns the specimen Z where that ray crosses X; needs |sin θ| > 0.
  double ray_z(int view, double u, double x) const;
  /// Returns true up to 45°, where rays cross the rows z = const more steeply than the columns
  /// x = const.
  bool is_flat(int view) const;

  /// The smallest and the largest X that any ray of any view reaches inside the specimen, in
  /// pixels.
  struct Extent {
    double low, high;
  };
  Extent reach() const;
};

/// Returns the geometry whose tilt axis passes through the geometric centres, with hand +1.
TiltGeometry centred_geometry(std::int64_t width, std::int64_t height, double thickness,
                              std::vector<double> tilt_deg);

/// Returns the numbers of the views in order of tilt. Views of one tilt keep their order.
std::vector<std::size_t> order_of_tilts(std::span<const double> tilt_deg);

}  // namespace tomofield::geometry
