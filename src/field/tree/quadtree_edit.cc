#include "field/tree/quadtree_edit.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "base/check.h"
#include "kernels/lanes.h"

namespace tomofield::field {
namespace {

using Kind = LeafOrigin::Kind;

// The changes that the edit makes at each old node.
struct NodeChanges {
  std::vector<int> leaf;  // leaf number, −1 for inner nodes
  std::vector<bool> split, merge;

  NodeChanges(const Quadtree& tree, const QuadtreeEdit& edit)
      : leaf(tree.nodes().size(), -1), split(leaf.size()), merge(leaf.size()) {
    for (int i = 0; i < tree.num_leaves(); ++i)
      leaf[tree.leaves()[static_cast<std::size_t>(i)]] = i;
    for (const int i : edit.split) {
      const auto n = static_cast<std::size_t>(tree.leaves().at(static_cast<std::size_t>(i)));
      TOMOFIELD_CHECK(!split[n], "a leaf is split once");
      TOMOFIELD_CHECK(tree.nodes()[n].square.size % (2 * kernels::kLanes) == 0,
                      "a square is too small to be split");
      split[n] = true;
    }
    for (const int node : edit.merge) {
      const auto n = static_cast<std::size_t>(node);
      TOMOFIELD_CHECK(!merge.at(n) && !tree.nodes()[n].is_leaf(), "an inner node is merged once");
      for (int c = 0; c < 4; ++c) {
        const std::size_t child = static_cast<std::size_t>(tree.nodes()[n].first_child + c);
        TOMOFIELD_CHECK(leaf[child] >= 0 && !split[child], "only leaves that stay are merged");
      }
      merge[n] = true;
    }
  }
};

// A new node and its origin: an old node, or a quarter of the old leaf `old`.
struct Pending {
  QuadtreeNode node;
  std::size_t old = 0;
  int quarter = -1;
};

QuadtreeNode child_of(const QuadtreeNode& parent, int parent_index, int c) {
  QuadtreeNode child = parent;
  child.square = quarter_of(parent.square, c);
  child.level = parent.level + 1;
  child.parent = parent_index;
  return child;
}

LeafOrigin origin_of(const Pending& p, const Quadtree& tree, const NodeChanges& changes) {
  if (p.quarter >= 0) return {Kind::kQuarter, changes.leaf[p.old], p.quarter};
  if (!changes.merge[p.old]) return {Kind::kSame, changes.leaf[p.old], 0};
  const int first_child = tree.nodes()[p.old].first_child;
  return {Kind::kUnion, changes.leaf[static_cast<std::size_t>(first_child)], 0};
}

}  // namespace

EditedTree edit_tree(const Quadtree& tree, const QuadtreeEdit& edit) {
  const NodeChanges changes(tree, edit);
  std::vector<Pending> nodes;  // breadth first, so that children follow their parents
  for (int root = 0; root < tree.roots().columns * tree.roots().rows; ++root)
    nodes.push_back({tree.nodes()[static_cast<std::size_t>(root)], static_cast<std::size_t>(root)});
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const Pending parent = nodes[n];
    nodes[n].node.first_child = -1;
    const bool splits = changes.split[parent.old];
    const bool is_inner = parent.quarter < 0 && !changes.merge[parent.old] &&
                          (splits || !tree.nodes()[parent.old].is_leaf());
    if (!is_inner) continue;
    nodes[n].node.first_child = static_cast<int>(nodes.size());
    for (int c = 0; c < 4; ++c) {
      const QuadtreeNode child = child_of(parent.node, static_cast<int>(n), c);
      const int old_child = tree.nodes()[parent.old].first_child + c;
      nodes.push_back(splits ? Pending{child, parent.old, c}
                             : Pending{child, static_cast<std::size_t>(old_child)});
    }
  }
  std::vector<QuadtreeNode> plain;
  for (const Pending& p : nodes) plain.push_back(p.node);
  EditedTree edited{Quadtree(tree.roots(), std::move(plain)), {}};
  for (const int n : edited.tree.leaves())
    edited.origins.push_back(origin_of(nodes[static_cast<std::size_t>(n)], tree, changes));
  return edited;
}

}  // namespace tomofield::field
