#include "field/tree/quadtree_bands.h"

#include <gtest/gtest.h>

#include <vector>

namespace tomofield::field {
namespace {

// Returns three bands of two cells of 64 px. The middle band has leaves of 32 and 16 px.
Quadtree uneven_bands() {
  using enum Region;
  const RootGrid roots{.x0 = -64, .y0 = 32, .cell_size = 64, .columns = 2, .rows = 3};
  Quadtree tree(roots, {kMargin, kInterest, kMargin, kInterest, kMargin, kInterest});
  tree.split(3);
  tree.split(4);
  return tree;
}

TEST(QuadtreeBands, SomeBandsHaveTheirLeavesInOrder) {
  const Quadtree tree = uneven_bands();
  const Quadtree upper = some_bands(tree, {1, 3});
  EXPECT_EQ(upper.roots(),
            (RootGrid{.x0 = -64, .y0 = 96, .cell_size = 64, .columns = 2, .rows = 2}));
  const base::Range leaves = leaves_of_bands(tree, {1, 3});
  ASSERT_EQ(upper.num_leaves(), leaves.size());
  for (int leaf = 0; leaf < upper.num_leaves(); ++leaf) {
    EXPECT_EQ(upper.leaf(leaf).square, tree.leaf(leaves.begin + leaf).square);
    EXPECT_EQ(upper.leaf(leaf).region, tree.leaf(leaves.begin + leaf).region);
    EXPECT_EQ(upper.leaf(leaf).level, tree.leaf(leaves.begin + leaf).level);
  }
}

TEST(QuadtreeBands, JoinedBandsAreTheWholeTree) {
  const Quadtree tree = uneven_bands();
  const Quadtree both = joined(some_bands(tree, {0, 2}), some_bands(tree, {2, 3}));
  EXPECT_EQ(both.roots(), tree.roots());
  ASSERT_EQ(both.num_leaves(), tree.num_leaves());
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    EXPECT_EQ(both.leaf(leaf).square, tree.leaf(leaf).square);
  // The constructor that reads files checks parents and children.
  EXPECT_NO_THROW(Quadtree(both.roots(), both.nodes()));
}

}  // namespace
}  // namespace tomofield::field
