#include "field/tree/quadtree.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "base/check.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::field {

Square quarter_of(const Square& square, int quarter) {
  const std::int64_t half = square.size / 2;
  return {square.x0 + (quarter & 1) * half, square.y0 + (quarter >> 1) * half, half};
}

Quadtree::Quadtree(const RootGrid& roots, const std::vector<Region>& region_of) : roots_(roots) {
  TOMOFIELD_CHECK(roots.cell_size > 0 && roots.cell_size % kernels::kLanes == 0,
                  fmt::format("root cell of {} px", roots.cell_size));
  TOMOFIELD_CHECK(region_of.size() == static_cast<std::size_t>(roots.columns) * roots.rows,
                  "regions and root cells");
  for (int row = 0; row < roots.rows; ++row) {
    for (int column = 0; column < roots.columns; ++column) {
      QuadtreeNode node;
      node.square = {roots.x0 + column * roots.cell_size, roots.y0 + row * roots.cell_size,
                     roots.cell_size};
      node.region = region_of[static_cast<std::size_t>(row) * roots.columns + column];
      nodes_.push_back(node);
    }
  }
  number_leaves();
}

Quadtree::Quadtree(const RootGrid& roots, std::vector<QuadtreeNode> nodes)
    : roots_(roots), nodes_(std::move(nodes)) {
  const auto require = [](bool condition, const char* what) {
    if (!condition) throw Error(fmt::format("the stored quadtree is damaged: {}", what));
  };
  const auto num_nodes = static_cast<std::int64_t>(nodes_.size());
  const std::int64_t num_roots = static_cast<std::int64_t>(roots.columns) * roots.rows;
  require(roots.columns > 0 && roots.rows > 0 && num_nodes >= num_roots,
          "fewer nodes than root cells");
  require(num_nodes < std::numeric_limits<int>::max(), "too many nodes");
  constexpr std::int64_t kFar = std::int64_t{1} << 30;  // in pixels; no sum of these overflows
  require(roots.cell_size > 0 && roots.cell_size <= kFar && std::abs(roots.x0) <= kFar &&
              std::abs(roots.y0) <= kFar,
          "its root cells have a wrong size or place");
  // Each child names its one parent, so children are unique. Counting them therefore finds nodes
  // that cannot be reached from a root.
  std::int64_t num_reached = num_roots;
  for (std::int64_t n = 0; n < num_nodes; ++n) {
    const QuadtreeNode& node = nodes_[static_cast<std::size_t>(n)];
    require(node.square.size > 0 && node.square.size % kernels::kLanes == 0,
            "a square has a wrong size");
    if (n < num_roots) {
      const Square expected{roots.x0 + n % roots.columns * roots.cell_size,
                            roots.y0 + n / roots.columns * roots.cell_size, roots.cell_size};
      require(node.parent == -1 && node.level == 0 && node.square == expected,
              "a root cell is not in its place");
    }
    if (node.is_leaf()) continue;
    require(node.first_child > n && node.first_child <= num_nodes - 4, "a node has wrong children");
    num_reached += 4;
    for (int c = 0; c < 4; ++c) {
      const QuadtreeNode& child = nodes_[static_cast<std::size_t>(node.first_child + c)];
      require(child.parent == n && child.level == node.level + 1 &&
                  child.square == quarter_of(node.square, c),
              "a child is not a quarter of its parent");
    }
  }
  require(num_reached == num_nodes, "a node belongs to no parent");
  number_leaves();
}

void Quadtree::add_children(int index) {
  const QuadtreeNode parent = nodes_[static_cast<std::size_t>(index)];
  TOMOFIELD_CHECK(parent.square.size % (2 * kernels::kLanes) == 0,
                  fmt::format("splitting a square of {} px", parent.square.size));
  nodes_[static_cast<std::size_t>(index)].first_child = static_cast<int>(nodes_.size());
  for (int c = 0; c < 4; ++c) {
    QuadtreeNode child = parent;
    child.square = quarter_of(parent.square, c);
    child.level = parent.level + 1;
    child.parent = index;
    child.first_child = -1;
    nodes_.push_back(child);
  }
}

void Quadtree::number_leaves() {
  leaves_.clear();
  leaf_of_node_.assign(nodes_.size(), -1);
  std::vector<int> stack;
  for (int root = roots_.columns * roots_.rows - 1; root >= 0; --root) stack.push_back(root);
  while (!stack.empty()) {
    const int n = stack.back();
    stack.pop_back();
    const QuadtreeNode& node = nodes_[static_cast<std::size_t>(n)];
    if (node.is_leaf()) {
      leaf_of_node_[static_cast<std::size_t>(n)] = static_cast<int>(leaves_.size());
      leaves_.push_back(n);
    } else {
      for (int c = 3; c >= 0; --c) stack.push_back(node.first_child + c);
    }
  }
}

int Quadtree::band_of_leaf(int index) const {
  return static_cast<int>((leaf(index).square.y0 - roots_.y0) / roots_.cell_size);
}

void Quadtree::split(int leaf_index) {
  add_children(leaves_[static_cast<std::size_t>(leaf_index)]);
  number_leaves();
}

void Quadtree::split_to_level(Region region, int level) {
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n].is_leaf() && nodes_[n].region == region && nodes_[n].level < level)
      add_children(static_cast<int>(n));
  }
  number_leaves();
}

std::vector<int> Quadtree::leaves_across(std::int64_t y0, std::int64_t y1) const {
  std::vector<int> found;
  for (int i = 0; i < num_leaves(); ++i) {
    const Square& s = leaf(i).square;
    if (s.y0 < y1 && s.y1() > y0) found.push_back(i);
  }
  std::stable_sort(found.begin(), found.end(),
                   [this](int a, int b) { return leaf(a).square.x0 < leaf(b).square.x0; });
  return found;
}

Quadtree::Bounds Quadtree::bounds(const Square& square) const {
  const auto first = [](std::int64_t position, std::int64_t domain) {
    return static_cast<double>(position) + (position == domain ? 0.0 : kPixelCentre);
  };
  return {first(square.x0, roots_.x0), first(square.y0, roots_.y0),
          static_cast<double>(square.x1()) + kPixelCentre,
          static_cast<double>(square.y1()) + kPixelCentre};
}

int Quadtree::find_leaf(double x, double y) const {
  const double size = static_cast<double>(roots_.cell_size);
  const auto past_first_centre = [](double position, std::int64_t first) {
    const double distance = position - kPixelCentre - static_cast<double>(first);
    return distance < 0 && distance >= -kPixelCentre ? 0.0 : distance;
  };
  const double along_x = past_first_centre(x, roots_.x0), along_y = past_first_centre(y, roots_.y0);
  const double column = std::floor(along_x / size), row = std::floor(along_y / size);
  if (!(column >= 0 && column < roots_.columns && row >= 0 && row < roots_.rows)) return -1;
  int n = static_cast<int>(row) * roots_.columns + static_cast<int>(column);
  while (!nodes_[static_cast<std::size_t>(n)].is_leaf()) {
    const QuadtreeNode& node = nodes_[static_cast<std::size_t>(n)];
    const double half = static_cast<double>(node.square.size) / 2;
    const int right = along_x >= static_cast<double>(node.square.x0 - roots_.x0) + half ? 1 : 0;
    const int up = along_y >= static_cast<double>(node.square.y0 - roots_.y0) + half ? 2 : 0;
    n = node.first_child + right + up;
  }
  return leaf_of_node_[static_cast<std::size_t>(n)];
}

}  // namespace tomofield::field
