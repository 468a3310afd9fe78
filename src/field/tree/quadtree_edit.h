#pragma once

#include <vector>

#include "field/tree/quadtree.h"

namespace tomofield::field {

/// Changes of a tree that are made at once: each leaf is in at most one of them.
struct QuadtreeEdit {
  std::vector<int> split;  ///< leaf numbers: replaced by their four quarters
  std::vector<int> merge;  ///< node numbers: their four children, all leaves, become one
  bool is_empty() const { return split.empty() && merge.empty(); }
  bool operator==(const QuadtreeEdit&) const = default;
};

/// Where a leaf of the edited tree comes from.
struct LeafOrigin {
  enum class Kind { kSame, kQuarter, kUnion };
  Kind kind = Kind::kSame;
  int leaf = 0;     ///< of the old tree; the first of four consecutive ones for a union
  int quarter = 0;  ///< which of the old leaf's, x fastest
};

struct EditedTree {
  Quadtree tree;
  std::vector<LeafOrigin> origins;  ///< of each of its leaves
};

/// The tree after an edit; the edit must be one of this tree (leaves in two
/// changes, nodes whose children are not all leaves and squares too small to be
/// split are errors of the program).
EditedTree edit_tree(const Quadtree& tree, const QuadtreeEdit& edit);

}  // namespace tomofield::field
