#include "compact/place_tree.h"

#include <algorithm>
#include <cstddef>

namespace tomofield::compact {
namespace {

using field::QuadtreeNode;
using field::Region;

field::RootGrid covering_roots(const field::RootGrid& of_field, std::int64_t largest_side,
                               base::Range rows) {
  std::int64_t side = of_field.cell_size;
  while (side * 2 <= largest_side) side *= 2;
  const auto cells = [&](std::int64_t length) {
    return static_cast<int>((length + side - 1) / side);
  };
  return {.x0 = of_field.x0,
          .y0 = rows.begin,
          .cell_size = side,
          .columns = cells(of_field.columns * of_field.cell_size),
          .rows = cells(rows.size())};
}

}  // namespace

base::Range rows_of(const field::Field& field) {
  const field::RootGrid& roots = field.tree().roots();
  return {static_cast<int>(roots.y0), static_cast<int>(roots.y0 + roots.rows * roots.cell_size)};
}

PlaceSquares place_squares(const VertexDensities& vertices, std::int64_t largest_side,
                           base::Range rows) {
  PlaceSquares squares{.roots = covering_roots(vertices.field().tree().roots(), largest_side, rows),
                       .nodes = {},
                       .leaf_like = {}};
  const field::RootGrid& roots = squares.roots;
  for (int row = 0; row < roots.rows; ++row) {
    for (int column = 0; column < roots.columns; ++column) {
      QuadtreeNode node;
      node.square = {roots.x0 + column * roots.cell_size, roots.y0 + row * roots.cell_size,
                     roots.cell_size};
      squares.nodes.push_back(node);
    }
  }
  for (std::size_t i = 0; i < squares.nodes.size(); ++i) {
    const QuadtreeNode node = squares.nodes[i];
    const int like =
        vertices.is_outside(node.square) ? PlaceSquares::kOutside : vertices.leaf_like(node.square);
    squares.leaf_like.push_back(like);
    squares.nodes[i].region =
        like >= 0 ? vertices.field().tree().leaf(like).region : Region::kMargin;
    if (like == PlaceSquares::kOutside || node.square.size <= vertices.smallest_side()) continue;
    squares.nodes[i].first_child = static_cast<int>(squares.nodes.size());
    for (int quarter = 0; quarter < 4; ++quarter) {
      QuadtreeNode child;
      child.square = field::quarter_of(node.square, quarter);
      child.level = node.level + 1;
      child.parent = static_cast<int>(i);
      squares.nodes.push_back(child);
    }
  }
  return squares;
}

field::Quadtree chosen_tree(const PlaceSquares& squares, const Choice& choice,
                            std::vector<std::size_t>& place_of_leaf) {
  std::vector<QuadtreeNode> nodes;
  std::vector<int> place_of_node, node_of_place(squares.nodes.size(), -1);
  for (std::size_t i = 0; i < squares.nodes.size(); ++i) {
    if (choice.candidate[i] == kUnused) continue;
    QuadtreeNode node = squares.nodes[i];
    if (node.parent >= 0) node.parent = node_of_place[static_cast<std::size_t>(node.parent)];
    node_of_place[i] = static_cast<int>(nodes.size());
    place_of_node.push_back(static_cast<int>(i));
    nodes.push_back(node);
  }
  for (QuadtreeNode& node : nodes) {
    const auto place =
        static_cast<std::size_t>(place_of_node[static_cast<std::size_t>(&node - nodes.data())]);
    node.first_child =
        choice.candidate[place] == kSplit
            ? node_of_place[static_cast<std::size_t>(squares.nodes[place].first_child)]
            : -1;
  }
  field::Quadtree tree(squares.roots, std::move(nodes));
  place_of_leaf.clear();
  for (const int node : tree.leaves())
    place_of_leaf.push_back(
        static_cast<std::size_t>(place_of_node[static_cast<std::size_t>(node)]));
  return tree;
}

}  // namespace tomofield::compact
