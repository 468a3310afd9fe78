#include "compact/place_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "field/field.h"

namespace tomofield::compact {
namespace {

using field::Region;
using field::Square;

// Returns three cells of 32 px in a row from (-32, 0): a margin whose vertices are 4 px apart, and
// two cells with a vertex a pixel.
std::unique_ptr<field::Field> small_field() {
  const field::RootGrid roots{.x0 = -32, .y0 = 0, .cell_size = 32, .columns = 3, .rows = 1};
  const field::LeafShape fine{.nx = 33, .ny = 33, .nz = 5};
  return field::make_field(
      FieldKind::kGrid,
      field::Quadtree(roots, {Region::kMargin, Region::kInterest, Region::kInterest}), 8.0,
      {{.nx = 9, .ny = 9, .nz = 3}, fine, fine});
}

constexpr Rectangle kRegion{.x0 = 0, .y0 = 0, .x1 = 64, .y1 = 32};

int find(const PlaceSquares& squares, const Square& square) {
  const auto found = std::ranges::find_if(
      squares.nodes, [&](const field::QuadtreeNode& node) { return node.square == square; });
  return found == squares.nodes.end() ? -1 : static_cast<int>(found - squares.nodes.begin());
}

TEST(PlaceTree, RootsAreAsLargeAsTheLargestSideAndCoverTheField) {
  const auto field = small_field();
  const VertexDensities vertices(*field, kRegion);
  const PlaceSquares of_64 = place_squares(vertices, 64, rows_of(*field));
  EXPECT_EQ(of_64.roots,
            (field::RootGrid{.x0 = -32, .y0 = 0, .cell_size = 64, .columns = 2, .rows = 1}));
  EXPECT_EQ(place_squares(vertices, 16, rows_of(*field)).roots, field->tree().roots())
      << "root cells are not cut";
}

TEST(PlaceTree, SquaresBecomeLeavesWhereTheirVerticesAreAlike) {
  const auto field = small_field();
  const PlaceSquares squares = place_squares(VertexDensities(*field, kRegion), 64, rows_of(*field));
  const auto like = [&](const Square& square) {
    const int node = find(squares, square);
    EXPECT_GE(node, 0);
    return squares.leaf_like[static_cast<std::size_t>(node)];
  };
  EXPECT_EQ(like({-32, 0, 64}), PlaceSquares::kNone) << "margin and region";
  EXPECT_EQ(like({-32, 0, 32}), PlaceSquares::kOutside) << "the margin";
  EXPECT_EQ(like({0, 0, 32}), 1);
  EXPECT_EQ(like({48, 16, 16}), 2);
  EXPECT_EQ(like({64, 0, 32}), PlaceSquares::kOutside);
  EXPECT_EQ(find(squares, {64, 0, 16}), -1) << "nothing is to be divided there";
  EXPECT_EQ(find(squares, {0, 0, 8}), -1) << "leaves are at least a slab wide";
  for (std::size_t i = 0; i < squares.nodes.size(); ++i) {
    const field::QuadtreeNode& node = squares.nodes[i];
    for (int quarter = 0; quarter < 4 && node.first_child >= 0; ++quarter) {
      const auto child = static_cast<std::size_t>(node.first_child + quarter);
      EXPECT_EQ(squares.nodes[child].square, field::quarter_of(node.square, quarter));
      EXPECT_EQ(squares.nodes[child].parent, static_cast<int>(i));
      EXPECT_EQ(squares.nodes[child].level, node.level + 1);
    }
  }
}

TEST(PlaceTree, LeavesAreTheSquaresThatAreChosen) {
  const auto field = small_field();
  const PlaceSquares squares = place_squares(VertexDensities(*field, kRegion), 64, rows_of(*field));
  const auto at = [&](const Square& square) {
    return static_cast<std::size_t>(find(squares, square));
  };
  Choice choice{.candidate = std::vector<int>(squares.nodes.size(), kUnused)};
  for (const Square& split : {Square{-32, 0, 64}, Square{32, 0, 64}, Square{32, 0, 32}})
    choice.candidate[at(split)] = kSplit;
  std::vector<Square> expected;
  for (const Square& parent : {Square{-32, 0, 64}, Square{32, 0, 64}, Square{32, 0, 32}}) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      const Square child = field::quarter_of(parent, quarter);
      if (choice.candidate[at(child)] == kSplit) continue;
      choice.candidate[at(child)] = 3;
      expected.push_back(child);
    }
  }
  std::vector<std::size_t> place_of_leaf;
  const field::Quadtree tree = chosen_tree(squares, choice, place_of_leaf);
  EXPECT_EQ(tree.roots(), squares.roots);
  std::vector<Square> leaves;
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
    leaves.push_back(tree.leaf(leaf).square);
    const std::size_t place = place_of_leaf[static_cast<std::size_t>(leaf)];
    EXPECT_EQ(squares.nodes[place].square, leaves.back());
    EXPECT_EQ(squares.nodes[place].region, tree.leaf(leaf).region);
  }
  EXPECT_TRUE(std::ranges::is_permutation(leaves, expected));
  EXPECT_EQ(tree.leaf(tree.find_leaf(40, 8)).square, (Square{32, 0, 16}));
}

}  // namespace
}  // namespace tomofield::compact
