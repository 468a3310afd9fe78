#include "tilt_series/motion_map.h"

#include <algorithm>
#include <cstddef>

#include "base/threads/parallel.h"

namespace tomofield::tilt_series {
namespace {

using Vector = geometry::ViewWarp::Vector;

constexpr int kCells = 128;  // along each side

}  // namespace

MotionMap::MotionMap(const geometry::ViewWarp& warp)
    : width_px_(warp.width_px), height_px_(warp.height_px), moved_((kCells + 1) * (kCells + 1)) {
  base::parallel_for("map local motion", kCells + 1, [&](std::int64_t row) {
    const double y = (static_cast<double>(row) / kCells - 0.5) * height_px_;
    for (std::int64_t column = 0; column <= kCells; ++column) {
      const double x = (static_cast<double>(column) / kCells - 0.5) * width_px_;
      const Vector source = warp.source_of(x, y);
      moved_[static_cast<std::size_t>(row * (kCells + 1) + column)] = {source[0] - x,
                                                                       source[1] - y};
    }
  });
}

Vector MotionMap::source_of(double x, double y) const {
  const auto cells = [](double part) {
    return std::clamp((part + 0.5) * kCells, 0.0, static_cast<double>(kCells));
  };
  const double across = cells(x / width_px_), along = cells(y / height_px_);
  const int column = std::min(static_cast<int>(across), kCells - 1);
  const int row = std::min(static_cast<int>(along), kCells - 1);
  const double fx = across - column, fy = along - row;
  const Vector* const low = &moved_[static_cast<std::size_t>(row * (kCells + 1) + column)];
  const Vector* const high = low + kCells + 1;
  const auto moved = [&](std::size_t axis) {
    return (1 - fy) * ((1 - fx) * low[0][axis] + fx * low[1][axis]) +
           fy * ((1 - fx) * high[0][axis] + fx * high[1][axis]);
  };
  return {x + moved(0), y + moved(1)};
}

}  // namespace tomofield::tilt_series
