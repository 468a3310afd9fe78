#include "projection/leaf_crossings.h"

#include <algorithm>
#include <cmath>

#include "base/range.h"

namespace tomofield::projection {
namespace {

using geometry::HeightRange;
using Line = geometry::RayBundle::Line;

void descend(const field::Quadtree& tree, int index, const Line& line, const HeightRange& heights,
             std::vector<LeafCrossing>& crossings) {
  const field::QuadtreeNode& node = tree.nodes()[static_cast<std::size_t>(index)];
  const field::Quadtree::Bounds b = tree.bounds(node.square);
  const HeightRange inside = clip(line, {b.x0, b.y0, b.x1, b.y1}, heights);
  if (inside.empty()) return;
  if (node.is_leaf()) {
    crossings.push_back({tree.leaf_of_node(index), inside});
    return;
  }
  for (int c = 0; c < 4; ++c) descend(tree, node.first_child + c, line, heights, crossings);
}

// Returns the root cells along one axis that positions between a and b touch.
base::Range cells_between(double a, double b, std::int64_t origin, std::int64_t size, int count) {
  const auto cell = [&](double position) {
    const double at =
        std::floor((position - static_cast<double>(origin)) / static_cast<double>(size));
    return static_cast<int>(std::clamp(at, -1.0, static_cast<double>(count)));
  };
  // One cell more on either side protects against rounding; clip() decides.
  return {std::max(cell(std::min(a, b)) - 1, 0), std::min(cell(std::max(a, b)) + 2, count)};
}

}  // namespace

void find_crossings(const field::Quadtree& tree, const Line& line, const HeightRange& heights,
                    std::vector<LeafCrossing>& crossings) {
  if (heights.empty()) return;
  const field::RootGrid& roots = tree.roots();
  const auto along_x = [&](double z) { return line.x0 + line.x_per_z * z; };
  const auto along_y = [&](double z) { return line.y0 + line.y_per_z * z; };
  const base::Range columns = cells_between(along_x(heights.low), along_x(heights.high), roots.x0,
                                            roots.cell_size, roots.columns);
  const base::Range rows = cells_between(along_y(heights.low), along_y(heights.high), roots.y0,
                                         roots.cell_size, roots.rows);
  for (int row = rows.begin; row < rows.end; ++row) {
    for (int column = columns.begin; column < columns.end; ++column)
      descend(tree, row * roots.columns + column, line, heights, crossings);
  }
}

}  // namespace tomofield::projection
