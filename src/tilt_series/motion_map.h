#pragma once

#include <vector>

#include "geometry/view_warp.h"

namespace tomofield::tilt_series {

/// Maps each place of a view without local motion to its place in the view with it. The map holds
/// places on a lattice of 128 × 128 cells and interpolates linearly between them. Nodes that differ
/// by a pixel from their neighbours make an error below 0.005 pixels.
class MotionMap {
 public:
  explicit MotionMap(const geometry::ViewWarp& warp);

  /// Returns ViewWarp::source_of(x, y), relative to the view's centre.
  geometry::ViewWarp::Vector source_of(double x, double y) const;

 private:
  double width_px_, height_px_;
  std::vector<geometry::ViewWarp::Vector> moved_;  // [y, x]: the source less the place
};

}  // namespace tomofield::tilt_series
