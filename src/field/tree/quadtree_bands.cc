#include "field/tree/quadtree_bands.h"

#include <utility>
#include <vector>

#include "base/check.h"

namespace tomofield::field {
namespace {

// Appends some nodes of a tree, all of one level or deeper, and gives them the numbers that they
// have among `nodes`. The root cells come before all other nodes, so they are appended first.
class NodeCopy {
 public:
  explicit NodeCopy(std::vector<QuadtreeNode>& nodes) : nodes_(nodes) {}

  void add_roots(const Quadtree& tree, base::Range roots) {
    for (int root = roots.begin; root < roots.end; ++root) {
      pending_.push_back({&tree, root, static_cast<int>(nodes_.size())});
      nodes_.push_back(tree.nodes()[static_cast<std::size_t>(root)]);
    }
  }

  // Adds what is below the root cells.
  void add_children() {
    for (std::size_t i = 0; i < pending_.size(); ++i) {
      const Pending from = pending_[i];
      const QuadtreeNode& node = from.tree->nodes()[static_cast<std::size_t>(from.node)];
      if (node.is_leaf()) continue;
      nodes_[static_cast<std::size_t>(from.copy)].first_child = static_cast<int>(nodes_.size());
      for (int child = node.first_child; child < node.first_child + 4; ++child) {
        pending_.push_back({from.tree, child, static_cast<int>(nodes_.size())});
        nodes_.push_back(from.tree->nodes()[static_cast<std::size_t>(child)]);
        nodes_.back().parent = from.copy;
      }
    }
  }

 private:
  struct Pending {
    const Quadtree* tree;
    int node, copy;
  };
  std::vector<QuadtreeNode>& nodes_;
  std::vector<Pending> pending_;
};

}  // namespace

Quadtree some_bands(const Quadtree& tree, base::Range bands) {
  RootGrid roots = tree.roots();
  const base::Range all{0, roots.rows};
  TOMOFIELD_CHECK(all.contains(bands), "bands of the tree");
  roots.y0 += bands.begin * roots.cell_size;
  roots.rows = bands.size();
  std::vector<QuadtreeNode> nodes;
  NodeCopy copy(nodes);
  copy.add_roots(tree, {bands.begin * roots.columns, bands.end * roots.columns});
  copy.add_children();
  return {roots, std::move(nodes)};
}

bool is_joinable(const Quadtree& lower, const Quadtree& upper) {
  RootGrid expected = lower.roots();
  expected.y0 += expected.rows * expected.cell_size;
  expected.rows = upper.roots().rows;
  return upper.roots() == expected;
}

Quadtree joined(const Quadtree& lower, const Quadtree& upper) {
  TOMOFIELD_CHECK(is_joinable(lower, upper), "bands that follow each other");
  RootGrid roots = lower.roots();
  roots.rows += upper.roots().rows;
  std::vector<QuadtreeNode> nodes;
  NodeCopy copy(nodes);
  for (const Quadtree* tree : {&lower, &upper})
    copy.add_roots(*tree, {0, tree->roots().rows * roots.columns});
  copy.add_children();
  return {roots, std::move(nodes)};
}

base::Range leaves_of_bands(const Quadtree& tree, base::Range bands) {
  const auto first_of = [&](int band) {
    int leaf = 0;
    while (leaf < tree.num_leaves() && tree.band_of_leaf(leaf) < band) ++leaf;
    return leaf;
  };
  return {first_of(bands.begin), first_of(bands.end)};
}

}  // namespace tomofield::field
