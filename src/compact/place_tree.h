#pragma once

#include <vector>

#include "base/range.h"
#include "compact/structure.h"
#include "compact/vertex_densities.h"
#include "field/tree/quadtree.h"

namespace tomofield::compact {

/// The squares that leaves of a compact model may be: a quadtree over the whole field, as deep as
/// the field's vertices allow.
struct PlaceSquares {
  field::RootGrid roots;
  /// The nodes, as in a tree of a field: root cells first, and children after their parent.
  std::vector<field::QuadtreeNode> nodes;
  /// A leaf of the field with the vertices of this square. kNone: the square cannot be a leaf,
  /// because its parts have different vertices. kOutside: it is out of the field, or out of the
  /// region of interest (VertexDensities::is_outside).
  std::vector<int> leaf_like;
  static constexpr int kNone = -1, kOutside = -2;
};

/// Returns the rows of the plane that a field covers.
base::Range rows_of(const field::Field& field);

/// Returns the squares of some rows of the plane, with sides from the smallest one
/// (VertexDensities::smallest_side) to `largest_side`, or to the field's root cells if these are
/// larger. The rows must begin where a band does, and hold whole squares of the largest side,
/// unless they end with the field.
PlaceSquares place_squares(const VertexDensities& vertices, std::int64_t largest_side,
                           base::Range rows);

/// Returns the tree of a field whose leaves are the places that are chosen. `place_of_leaf` becomes
/// the place of each leaf.
field::Quadtree chosen_tree(const PlaceSquares& squares, const Choice& choice,
                            std::vector<std::size_t>& place_of_leaf);

}  // namespace tomofield::compact
