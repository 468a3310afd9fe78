#pragma once

#include <vector>

#include "field/tree/quadtree.h"

namespace tomofield::field {

/// Changes of a tree that are made together. Each leaf takes part in at most one of them.
struct QuadtreeEdit {
  std::vector<int> split;  ///< numbers of leaves that are replaced by their four quarters
  std::vector<int> merge;  ///< numbers of nodes whose four children, all leaves, become one leaf
  bool is_empty() const { return split.empty() && merge.empty(); }
  bool operator==(const QuadtreeEdit&) const = default;
};

/// The origin of a leaf of the edited tree.
struct LeafOrigin {
  enum class Kind { kSame, kQuarter, kUnion };
  Kind kind = Kind::kSame;
  int leaf = 0;     ///< leaf of the old tree; for a union, the first of four consecutive ones
  int quarter = 0;  ///< quarter of the old leaf, x fastest
};

/// The result of an edit.
struct EditedTree {
  Quadtree tree;
  std::vector<LeafOrigin> origins;  ///< origin of each leaf of `tree`
};

/// Returns the tree after an edit. Throws std::logic_error for an edit that does not fit the tree:
/// a leaf in two changes, a node whose children are not all leaves, or a square too small to split.
EditedTree edit_tree(const Quadtree& tree, const QuadtreeEdit& edit);

}  // namespace tomofield::field
