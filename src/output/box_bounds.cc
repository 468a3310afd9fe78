#include "output/box_bounds.h"

#include <algorithm>
#include <limits>

namespace tomofield::output {

using field::Point;

BoxBounds::BoxBounds(const field::OrientedBox& box) {
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (int corner = 0; corner < 8; ++corner) {
    Point voxel{};
    for (std::size_t a = 0; a < 3; ++a)
      voxel[a] = (corner >> a & 1) ? static_cast<double>(box.size[a]) : 0.0;
    const Point at = box.position(voxel);
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], at[a]);
      high[a] = std::max(high[a], at[a]);
    }
  }
}

std::optional<std::size_t> BoxBounds::axis_apart(const BoxBounds& other) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (low[a] >= other.high[a] || high[a] <= other.low[a]) return a;
  return std::nullopt;
}

std::optional<std::size_t> BoxBounds::axis_beyond(const BoxBounds& other,
                                                  double tolerance_px) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (low[a] < other.low[a] - tolerance_px || high[a] > other.high[a] + tolerance_px) return a;
  return std::nullopt;
}

BoxBounds field_bounds(const Model& model) {
  const field::RootGrid& roots = model.tree().roots();
  const auto x0 = static_cast<double>(roots.x0), y0 = static_cast<double>(roots.y0);
  return {{x0, y0, 0.0},
          {x0 + static_cast<double>(roots.columns * roots.cell_size),
           y0 + static_cast<double>(roots.rows * roots.cell_size), model.thickness()}};
}

BoxBounds region_bounds(const ModelInfo& model) {
  const Rectangle& roi = model.roi;
  return {{static_cast<double>(roi.x0), static_cast<double>(roi.y0), 0.0},
          {static_cast<double>(roi.x1), static_cast<double>(roi.y1), model.geometry.thickness}};
}

}  // namespace tomofield::output
