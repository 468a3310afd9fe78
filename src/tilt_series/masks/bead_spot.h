#pragma once

#include <cstddef>

namespace tomofield::tilt_series {

/// The place of a bead in a view, in pixels; pixel i covers [i, i + 1).
struct BeadSpot {
  std::size_t view = 0;
  double x_px = 0.0, y_px = 0.0;
};

}  // namespace tomofield::tilt_series
