#include "field/tree/quadtree.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "base/random.h"
#include "tomofield/error.h"

namespace tomofield::field {
namespace {

constexpr RootGrid kRoots{.x0 = -64, .y0 = 32, .cell_size = 64, .columns = 3, .rows = 2};

// Returns a tree of three columns: the middle one of interest, margins on both sides.
Quadtree three_columns() {
  using enum Region;
  return Quadtree(kRoots, {kMargin, kInterest, kMargin, kMargin, kInterest, kMargin});
}

// Returns a tree with leaves of 64, 32 and 16 px beside each other.
Quadtree uneven_tree() {
  Quadtree tree = three_columns();
  tree.split(1);  // middle cell of the first band: leaves 1 … 4
  tree.split(2);  // its lower right quarter
  return tree;
}

// Checks that every point of the domain is in exactly one leaf.
void expect_tiling(const Quadtree& tree) {
  const RootGrid& roots = tree.roots();
  std::int64_t area = 0;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    const Square& a = tree.leaf(i).square;
    area += a.size * a.size;
    for (int j = 0; j < i; ++j) {
      const Square& b = tree.leaf(j).square;
      EXPECT_FALSE(a.x0 < b.x1() && b.x0 < a.x1() && a.y0 < b.y1() && b.y0 < a.y1()) << i << j;
    }
  }
  EXPECT_EQ(area, roots.cell_size * roots.cell_size * roots.columns * roots.rows);
}

TEST(Quadtree, StartsWithALeafForEachRootCell) {
  const Quadtree tree = three_columns();
  ASSERT_EQ(tree.num_leaves(), 6);
  EXPECT_EQ(tree.leaf(4).square, (Square{0, 96, 64}));
  EXPECT_EQ(tree.leaf(4).region, Region::kInterest);
  EXPECT_EQ(tree.leaf(5).region, Region::kMargin);
  expect_tiling(tree);
}

TEST(Quadtree, SplitsALeafIntoItsQuarters) {
  const Quadtree tree = uneven_tree();
  ASSERT_EQ(tree.num_leaves(), 12);
  expect_tiling(tree);
  const QuadtreeNode& quarter = tree.leaf(5);  // last of the 16-px leaves
  EXPECT_EQ(quarter.square, (Square{48, 48, 16}));
  EXPECT_EQ(quarter.level, 2);
  EXPECT_EQ(quarter.region, Region::kInterest);
  const QuadtreeNode& parent = tree.nodes()[static_cast<std::size_t>(quarter.parent)];
  EXPECT_EQ(parent.square, (Square{32, 32, 32}));
  EXPECT_FALSE(parent.is_leaf());
}

TEST(Quadtree, SplitsARegionToALevel) {
  Quadtree tree = uneven_tree();
  tree.split_to_level(Region::kInterest, 2);
  expect_tiling(tree);
  for (int i = 0; i < tree.num_leaves(); ++i)
    EXPECT_EQ(tree.leaf(i).square.size, tree.leaf(i).region == Region::kInterest ? 16 : 64);
  EXPECT_EQ(tree.num_leaves(), 2 * 16 + 4);
}

TEST(Quadtree, RefusesLeavesBelowASlab) {
  Quadtree tree = uneven_tree();
  EXPECT_THROW(tree.split(2), std::logic_error);
}

TEST(Quadtree, FindsTheLeafOfEveryPoint) {
  const Quadtree tree = uneven_tree();
  base::Random random(1);
  for (int n = 0; n < 2000; ++n) {
    const double x = random.uniform(-64, 128.5), y = random.uniform(32, 160.5);
    const int found = tree.find_leaf(x, y);
    ASSERT_GE(found, 0);
    const Square& s = tree.leaf(found).square;
    const double low_x = s.x0 == -64 ? -64.0 : static_cast<double>(s.x0) + 0.5;
    const double low_y = s.y0 == 32 ? 32.0 : static_cast<double>(s.y0) + 0.5;
    EXPECT_TRUE(x >= low_x && x < static_cast<double>(s.x1()) + 0.5);
    EXPECT_TRUE(y >= low_y && y < static_cast<double>(s.y1()) + 0.5);
    const Quadtree::Bounds bounds = tree.bounds(s);
    EXPECT_EQ(bounds.x0, low_x);
    EXPECT_EQ(bounds.y0, low_y);
    EXPECT_EQ(bounds.x1, static_cast<double>(s.x1()) + 0.5);
    EXPECT_EQ(bounds.y1, static_cast<double>(s.y1()) + 0.5);
  }
  // Faces lie on centres of pixels. A face belongs to the leaf above it. The domain's last faces
  // belong to no leaf.
  EXPECT_EQ(tree.leaf(tree.find_leaf(32.5, 40)).square.x0, 32);
  EXPECT_EQ(tree.find_leaf(128.5, 40), -1);
  EXPECT_EQ(tree.find_leaf(0, 160.5), -1);
  EXPECT_EQ(tree.find_leaf(-64.001, 40), -1);
  EXPECT_EQ(tree.find_leaf(std::nan(""), 40), -1);
}

TEST(Quadtree, FindsLeavesAcrossRowsInOrderOfX) {
  const Quadtree tree = uneven_tree();
  std::vector<Square> squares;
  for (const int leaf : tree.leaves_across(32, 48)) squares.push_back(tree.leaf(leaf).square);
  EXPECT_EQ(squares, (std::vector<Square>{
                         {-64, 32, 64}, {0, 32, 32}, {32, 32, 16}, {48, 32, 16}, {64, 32, 64}}));
  EXPECT_EQ(tree.leaves_across(96, 112).size(), 3u);
  EXPECT_EQ(tree.leaves_across(0, 32).size(), 0u);
  EXPECT_EQ(tree.leaves_across(0, 1000).size(), 12u);
}

TEST(Quadtree, NumbersLeavesBandByBand) {
  const Quadtree tree = uneven_tree();
  int last_band = 0;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    const int band = tree.band_of_leaf(i);
    EXPECT_GE(band, last_band);
    EXPECT_EQ(band, tree.leaf(i).square.y0 < 96 ? 0 : 1);
    last_band = band;
  }
  EXPECT_EQ(last_band, 1);
}

TEST(Quadtree, ComesBackFromItsNodes) {
  const Quadtree tree = uneven_tree();
  const Quadtree copy(tree.roots(), tree.nodes());
  EXPECT_EQ(copy.leaves(), tree.leaves());
  for (int i = 0; i < tree.num_leaves(); ++i) EXPECT_EQ(copy.leaf(i).square, tree.leaf(i).square);
}

TEST(Quadtree, RefusesStoredNodesThatAreNoTree) {
  const Quadtree tree = uneven_tree();
  struct Damage {
    const char* what;
    std::function<void(RootGrid&, std::vector<QuadtreeNode>&)> apply;
  };
  using Nodes = std::vector<QuadtreeNode>;
  const std::vector<Damage> damages = {
      {"a root cell missing", [](RootGrid& r, Nodes&) { r.rows = 5; }},
      {"no columns", [](RootGrid& r, Nodes&) { r.columns = 0; }},
      {"columns × rows overflows", [](RootGrid& r, Nodes&) { r.columns = r.rows = 1 << 17; }},
      {"cells of no slab", [](RootGrid& r, Nodes&) { r.cell_size = 60; }},
      {"a root elsewhere", [](RootGrid&, Nodes& n) { n[3].square.x0 += 16; }},
      {"all roots elsewhere", [](RootGrid& r, Nodes&) { r.x0 += 16; }},
      {"a root of another size", [](RootGrid& r, Nodes&) { r.cell_size = 128; }},
      {"a root with a parent", [](RootGrid&, Nodes& n) { n[2].parent = 0; }},
      {"a node that is its own ancestor", [](RootGrid&, Nodes& n) { n[1].first_child = 1; }},
      {"children past the end", [](RootGrid&, Nodes& n) { n[0].first_child = 11; }},
      {"two parents of the same children", [](RootGrid&, Nodes& n) { n[4].first_child = 6; }},
      {"a child of the wrong size", [](RootGrid&, Nodes& n) { n[7].square.size = 16; }},
      {"a child at the wrong place", [](RootGrid&, Nodes& n) { n[8].square.y0 = 32; }},
      {"a child at the wrong level", [](RootGrid&, Nodes& n) { n[8].level = 3; }},
      {"a node that nothing leads to", [](RootGrid&, Nodes& n) { n[1].first_child = -1; }},
      {"fewer nodes than needed", [](RootGrid&, Nodes& n) { n.pop_back(); }},
      {"a parent past the end", [](RootGrid&, Nodes& n) { n[9].parent = 13; }},
      {"children of a slab's size", [](RootGrid&, Nodes& n) { n[10].first_child = 6; }},
  };
  for (const Damage& damage : damages) {
    RootGrid roots = tree.roots();
    Nodes nodes = tree.nodes();
    damage.apply(roots, nodes);
    EXPECT_THROW(Quadtree(roots, nodes), Error) << damage.what;
  }
}

}  // namespace
}  // namespace tomofield::field
