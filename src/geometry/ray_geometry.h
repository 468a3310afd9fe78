#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "geometry/tilt_geometry.h"
#include "tomofield/options.h"

namespace tomofield::geometry {

/// The rays of one view, which are parallel. The ray that ends at (u, v) of the raw image passes
/// height Z of the specimen at
///
///   X = x[0] + x[1] u + x[2] v + x[3] Z,    Y = y[0] + y[1] u + y[2] v + y[3] Z
///
/// and is length_per_z pixels long for each pixel of height. All coordinates are in pixels.
struct RayBundle {
  std::array<double, 4> x{}, y{};
  double length_per_z = 1.0;

  /// A ray by its (X, Y) at Z = 0 and their change with Z.
  struct Line {
    double x0, y0, x_per_z, y_per_z;
  };
  Line line(double u, double v) const {
    return {x[0] + x[1] * u + x[2] * v, y[0] + y[1] * u + y[2] * v, x[3], y[3]};
  }
};

/// Views as they were recorded, without resampling. Each view has its own in-plane rotation, shift
/// and x-axis tilt. With C = (axis_x, height / 2, axis_z) of the aligned geometry, a specimen point
/// P is recorded at p (docs/geometry.md):
///
///   q = Ry(θ) Rx(α) diag(1, 1, hand) (P − C),   p = M (q + C − c) + shift
///
/// Only x and y of q are used. q + C is the position in the aligned view and c is that view's
/// centre. p is relative to the raw image's centre. M is Rz(ROT) if the alignment is a rotation.
struct RayGeometry {
  TiltGeometry aligned;                          ///< θ, hand and centres in the specimen's frame
  std::vector<double> x_tilt_deg;                ///< α of each view
  std::vector<RawFromAligned> raw_from_aligned;  ///< M and shift of each view
  std::int64_t raw_width = 0,
               raw_height =
                   0;  ///< size of the recorded views, in pixels as large as the aligned ones

  int num_views() const { return aligned.num_views(); }
  /// Returns (u, v) in the raw image of a specimen point; pixel i covers [i, i + 1).
  std::array<double, 2> detector(int view, double x, double y, double z) const;
  RayBundle rays(int view) const;
};

/// A rectangle of the specimen's plane, [x0, x1) × [y0, y1), in pixels.
struct Extent2 {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// A part of a ray by its heights Z in [low, high), in pixels; empty if low >= high.
struct HeightRange {
  double low = 0, high = 0;
  bool empty() const { return !(low < high); }
};
/// Returns the heights within `range` at which a line lies over a rectangle. A line passes from one
/// rectangle to its neighbour at exactly the same number in both.
HeightRange clip(const RayBundle::Line& line, const Extent2& rectangle, const HeightRange& range);

/// Returns the rectangle around everything that rays through the region of interest reach, over all
/// views. It contains the region itself.
Extent2 reach_of_rays(const RayGeometry& geometry, const Rectangle& roi);

}  // namespace tomofield::geometry
