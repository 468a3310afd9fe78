#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::geometry {

/// The rays of one view, which are parallel: the ray that ends at (u, v) of the
/// raw image passes height Z of the specimen at
///
///   X = x[0] + x[1] u + x[2] v + x[3] Z,    Y = y[0] + y[1] u + y[2] v + y[3] Z
///
/// and is length_per_z pixels long for each pixel of height.
struct RayBundle {
  std::array<double, 4> x{}, y{};
  double length_per_z = 1.0;

  /// A ray: (X, Y) at Z = 0, and how they change with Z.
  struct Line {
    double x0, y0, x_per_z, y_per_z;
  };
  Line line(double u, double v) const {
    return {x[0] + x[1] * u + x[2] * v, y[0] + y[1] * u + y[2] * v, x[3], y[3]};
  }
};

/// Views as they were recorded, none resampled: each has its own in-plane
/// rotation, shift and x-axis tilt. With C = (axis_x, height / 2, axis_z) of the
/// aligned geometry, in the canonical form of CONVENTIONS,
///
///   q = Ry(θ) Rx(α) diag(1, 1, hand) (P − C),   p = M (q + C − c) + shift,
///
/// keeping x and y: q + C is the position in the aligned view, c that view's
/// centre, p is relative to the raw image's centre, and M is Rz(ROT) for a
/// rotation alone.
struct RayGeometry {
  TiltGeometry aligned;                          ///< θ, hand, centres; frame of the specimen
  std::vector<double> x_tilt_deg;                ///< α of each view
  std::vector<RawFromAligned> raw_from_aligned;  ///< of each view
  std::int64_t raw_width = 0,
               raw_height = 0;  ///< of the recorded views, pixels as the aligned ones

  int num_views() const { return aligned.num_views(); }
  /// (u, v) in the raw image of a specimen point; pixel i covers [i, i + 1).
  std::array<double, 2> detector(int view, double x, double y, double z) const;
  RayBundle rays(int view) const;
};

/// A rectangle of the specimen's plane, [x0, x1) × [y0, y1) in pixels.
struct Extent2 {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Part of a ray's heights, Z in [low, high); empty if low >= high.
struct HeightRange {
  double low = 0, high = 0;
  bool empty() const { return !(low < high); }
};
/// Where a line lies over a rectangle, within `range`. Rectangles that share a
/// side share the very number at which a line goes from one to the other.
HeightRange clip(const RayBundle::Line& line, const Extent2& rectangle, const HeightRange& range);

/// The rectangle around what is reached by the rays of every view that meet the
/// region of interest; that region itself is part of it.
Extent2 reach_of_rays(const RayGeometry& geometry, const Roi& roi);

}  // namespace tomofield::geometry
