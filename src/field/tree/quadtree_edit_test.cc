#include "field/tree/quadtree_edit.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "base/random.h"

namespace tomofield::field {
namespace {

using Kind = LeafOrigin::Kind;

constexpr RootGrid kRoots{.x0 = -64, .y0 = 32, .cell_size = 64, .columns = 3, .rows = 2};

Quadtree uneven_tree() {
  using enum Region;
  Quadtree tree(kRoots, {kMargin, kInterest, kMargin, kMargin, kInterest, kMargin});
  tree.split(1);  // leaves 1 … 4
  tree.split(2);  // leaves 2 … 5 of 16 px
  return tree;
}

// Checks that every leaf lies where its origin says, and that together they fill the domain.
void expect_origins(const Quadtree& before, const EditedTree& after) {
  ASSERT_EQ(static_cast<int>(after.origins.size()), after.tree.num_leaves());
  std::int64_t area = 0;
  for (int i = 0; i < after.tree.num_leaves(); ++i) {
    const QuadtreeNode& leaf = after.tree.leaf(i);
    const LeafOrigin& origin = after.origins[static_cast<std::size_t>(i)];
    const QuadtreeNode& old = before.leaf(origin.leaf);
    area += leaf.square.size * leaf.square.size;
    EXPECT_EQ(leaf.region, old.region);
    if (origin.kind == Kind::kSame) {
      EXPECT_EQ(leaf.square, old.square);
    }
    if (origin.kind == Kind::kQuarter) {
      EXPECT_EQ(leaf.square, quarter_of(old.square, origin.quarter));
    }
    if (origin.kind != Kind::kUnion) continue;
    for (int c = 0; c < 4; ++c)
      EXPECT_EQ(before.leaf(origin.leaf + c).square, quarter_of(leaf.square, c));
  }
  const RootGrid& roots = after.tree.roots();
  EXPECT_EQ(area, roots.cell_size * roots.cell_size * roots.columns * roots.rows);
}

TEST(EditTree, SplitsAndMergesAtOnce) {
  const Quadtree tree = uneven_tree();
  const int merged = tree.leaf(2).parent;
  const EditedTree edited = edit_tree(tree, {.split = {1, 9}, .merge = {merged}});
  expect_origins(tree, edited);
  EXPECT_EQ(edited.tree.num_leaves(), tree.num_leaves() + 3 + 3 - 3);
  const int found = edited.tree.find_leaf(40, 40);
  EXPECT_EQ(edited.tree.leaf(found).square, (Square{32, 32, 32}));
  EXPECT_EQ(edited.origins[static_cast<std::size_t>(found)].kind, Kind::kUnion);
  EXPECT_EQ(edited.origins[static_cast<std::size_t>(found)].leaf, 2);
  EXPECT_EQ(edited.tree.leaf(edited.tree.find_leaf(2, 34)).square, (Square{0, 32, 16}));
}

TEST(EditTree, AnEmptyEditKeepsTheTree) {
  const Quadtree tree = uneven_tree();
  const EditedTree edited = edit_tree(tree, {});
  ASSERT_EQ(edited.tree.num_leaves(), tree.num_leaves());
  for (int i = 0; i < tree.num_leaves(); ++i) {
    EXPECT_EQ(edited.tree.leaf(i).square, tree.leaf(i).square);
    EXPECT_EQ(edited.origins[static_cast<std::size_t>(i)].leaf, i);
  }
}

// Applies many edits in a row. Each tree is made again from its stored nodes.
TEST(EditTree, RandomEditsKeepTheTiling) {
  Quadtree tree(RootGrid{.x0 = 0, .y0 = 0, .cell_size = 128, .columns = 2, .rows = 1},
                {Region::kInterest, Region::kMargin});
  base::Random random(3);
  for (int n = 0; n < 60; ++n) {
    QuadtreeEdit edit;
    for (int i = 0; i < tree.num_leaves(); ++i) {
      if (tree.leaf(i).square.size > 16 && random.below(3) == 0) edit.split.push_back(i);
    }
    std::vector<bool> is_split(static_cast<std::size_t>(tree.num_leaves()));
    for (const int i : edit.split) is_split[static_cast<std::size_t>(i)] = true;
    for (int i = 0; i + 3 < tree.num_leaves(); ++i) {
      bool siblings = tree.leaf(i).parent >= 0 && random.below(2) == 0;
      for (int c = 0; c < 4; ++c)
        siblings = siblings && tree.leaf(i + c).parent == tree.leaf(i).parent &&
                   !is_split[static_cast<std::size_t>(i + c)];
      if (siblings) edit.merge.push_back(tree.leaf(i).parent);
    }
    const EditedTree edited = edit_tree(tree, edit);
    expect_origins(tree, edited);
    EXPECT_EQ(edited.tree.num_leaves(), tree.num_leaves() +
                                            3 * static_cast<int>(edit.split.size()) -
                                            3 * static_cast<int>(edit.merge.size()));
    EXPECT_EQ(Quadtree(edited.tree.roots(), edited.tree.nodes()).leaves(), edited.tree.leaves());
    tree = edited.tree;
  }
}

TEST(EditTree, RefusesEditsOfAnotherTree) {
  const Quadtree tree = uneven_tree();
  const int inner = tree.leaf(2).parent, grandparent = tree.leaf(1).parent;
  const std::vector<QuadtreeEdit> wrong = {
      {.split = {1, 1}, .merge = {}},          // the same leaf twice
      {.split = {2}, .merge = {}},             // a leaf too small to split
      {.split = {}, .merge = {inner, inner}},  // the same node twice
      {.split = {}, .merge = {grandparent}},   // a node with a child that is no leaf
      {.split = {}, .merge = {0}},             // a node that is a leaf
      {.split = {tree.num_leaves()}, .merge = {}},
      {.split = {}, .merge = {1000}},
  };
  for (const QuadtreeEdit& edit : wrong) EXPECT_THROW(edit_tree(tree, edit), std::logic_error);
}

}  // namespace
}  // namespace tomofield::field
