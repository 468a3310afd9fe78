#include "fit/halo.h"
#include "base/enum_names.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace tomofield::fit {
namespace {

using base::Range;

// Makes three columns and four rows of cells. Some are split, so there are leaves of three sizes.
field::Quadtree uneven_tree() {
  const field::RootGrid roots{.x0 = 5, .y0 = -7, .cell_size = 64, .columns = 3, .rows = 4};
  field::Quadtree tree(roots, std::vector<field::Region>(12, field::Region::kInterest));
  for (const int leaf : {10, 7, 4, 0}) tree.split(leaf);
  tree.split(1);
  return tree;
}

TEST(Share, LeavesOfBandsAreThoseInTheirRows) {
  const field::Quadtree tree = uneven_tree();
  int next = 0;
  for (int band = 0; band < 4; ++band) {
    const Range leaves = leaves_of_bands(tree, {band, band + 1});
    EXPECT_EQ(leaves.begin, next);
    next = leaves.end;
    for (int leaf = leaves.begin; leaf < leaves.end; ++leaf)
      EXPECT_EQ(tree.band_of_leaf(leaf), band);
  }
  EXPECT_EQ(next, tree.num_leaves());
}

measurement::RowShare share_of(Range bands) { return {bands, 0, 0}; }

// Tries all pairs of leaves: those that touch across the boundary belong in the halo.
TEST(Share, HaloLeavesTouchAcrossTheBoundary) {
  const field::Quadtree tree = uneven_tree();
  for (int boundary = 1; boundary < 4; ++boundary) {
    const std::int64_t y = tree.roots().y0 + boundary * 64;
    std::set<int> below, above;
    for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
      if (tree.leaf(leaf).square.y1() == y) below.insert(leaf);
      if (tree.leaf(leaf).square.y0 == y) above.insert(leaf);
    }
    const auto set_of = [](const std::vector<int>& leaves) {
      return std::set<int>(leaves.begin(), leaves.end());
    };
    const HaloLeaves lower = halo_leaves(tree, share_of({0, boundary}));
    const HaloLeaves upper = halo_leaves(tree, share_of({boundary, 4}));
    EXPECT_EQ(set_of(lower.own_last), below);
    EXPECT_EQ(set_of(lower.after), above);
    EXPECT_TRUE(lower.before.empty() && lower.own_first.empty());
    // Each receives the leaves that the other sends, in the same order.
    EXPECT_EQ(upper.before, lower.own_last);
    EXPECT_EQ(upper.own_first, lower.after);
    EXPECT_TRUE(upper.after.empty() && upper.own_last.empty());
    const std::vector<int> needed = needed_leaves(tree, share_of({boundary, 4}));
    EXPECT_EQ(static_cast<int>(needed.size()),
              leaves_of_bands(tree, {boundary, 4}).size() + std::ssize(below));
  }
}

// A process that works on the first rows of the next bands needs every leaf in these rows and in
// the row after them.
TEST(Share, HaloLeavesCoverTheRowsOfTheNextProcess) {
  const field::Quadtree tree = uneven_tree();
  for (const std::int64_t rows : {16, 32, 48}) {
    const HaloLeaves lower = halo_leaves(tree, {{0, 2}, rows, 0});
    const HaloLeaves upper = halo_leaves(tree, {{2, 4}, 0, rows});
    EXPECT_EQ(upper.own_first, lower.after);
    const std::int64_t y = tree.roots().y0 + 2 * 64;
    for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
      const field::Square& s = tree.leaf(leaf).square;
      EXPECT_EQ(std::ranges::count(lower.after, leaf), s.y0 <= y + rows && s.y1() > y ? 1 : 0);
    }
  }
}

// A neighbour that has nothing but what a halo brings sees the same densities on the face and in
// the row beside it.
TEST(Share, AFewParametersAreAllThatTheBoundaryNeeds) {
  const field::Quadtree tree = uneven_tree();
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    for (const auto& [ny, pixel] : {std::pair(33, 1), {65, 1}, {17, 2}, {5, 2}, {2, 4}}) {
      const std::vector<field::LeafShape> shapes(
          static_cast<std::size_t>(tree.num_leaves()),
          {.nx = 4, .ny = ny, .nz = 5, .rank_x = 2, .rank_y = 3, .rank_z = 1});
      const auto whole = field::make_field(kind, tree, 16.0, shapes);
      const auto part = field::make_field(kind, tree, 16.0, shapes);
      whole->initialise(base::Random(3), 0.5);
      for (const bool at_end : {false, true}) {
        const int leaf = 2;
        const field::Square& square = tree.leaf(leaf).square;
        const double face = static_cast<double>(at_end ? square.y1() : square.y0);
        const double row = face + (at_end ? -0.5 : 0.5) * pixel, at_face = face + 0.5;
        std::ranges::fill(part->parameters(), 0.0f);
        std::size_t copied = 0;
        for (const field::ParameterRuns& runs :
             whole->parameters_between(leaf, std::min(row, at_face), std::max(row, at_face))) {
          copied += runs.size();
          for (std::size_t i = 0; i < runs.size(); ++i) {
            const std::size_t at =
                whole->offset(leaf) + runs.first + i / runs.count * runs.stride + i % runs.count;
            part->parameters()[at] = whole->parameters()[at];
          }
        }
        if (ny > 5) {
          EXPECT_LT(copied, (whole->offset(leaf + 1) - whole->offset(leaf)) / 2);
        }
        const double x = static_cast<double>(square.x0) + 7.3, z = 5.1;
        for (const double y : {row, at_face}) {
          float seen = 0.0f, expected = 1.0f;
          part->point_densities(leaf, {{&x, 1}, {&y, 1}, {&z, 1}}, {&seen, 1});
          whole->point_densities(leaf, {{&x, 1}, {&y, 1}, {&z, 1}}, {&expected, 1});
          EXPECT_EQ(seen, expected)
              << base::name_of(kind) << " " << ny << " " << pixel << " " << at_end;
        }
      }
    }
  }
}

TEST(Share, WhatIsNotKeptStaysZeroAndTheRestIsTheSame) {
  const field::Quadtree tree = uneven_tree();
  const std::vector<field::LeafShape> shapes(
      static_cast<std::size_t>(tree.num_leaves()),
      {.nx = 3, .ny = 4, .nz = 5, .rank_x = 2, .rank_y = 2, .rank_z = 2});
  const std::vector<field::LeafShape> finer(
      shapes.size(), {.nx = 5, .ny = 7, .nz = 9, .rank_x = 2, .rank_y = 2, .rank_z = 2});
  const Range bands{1, 2};
  const std::vector<int> needed = needed_leaves(tree, share_of(bands));
  const auto whole = field::make_field(FieldKind::kVm, tree, 16.0, shapes);
  const auto part = field::make_field(FieldKind::kVm, tree, 16.0, shapes);
  part->keep_only(needed);
  whole->initialise(base::Random(3), 0.5);
  part->initialise(base::Random(3), 0.5);
  const auto whole_finer = whole->resampled(finer), part_finer = part->resampled(finer);
  const auto expect_part_of = [&](const field::Field& some, const field::Field& all) {
    for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
      const bool kept = std::ranges::find(needed, leaf) != needed.end();
      EXPECT_EQ(some.keeps(leaf), kept);
      for (std::size_t i = some.offset(leaf); i < some.offset(leaf + 1); ++i)
        ASSERT_EQ(some.parameters()[i], kept ? all.parameters()[i] : 0.0f) << leaf;
    }
  };
  expect_part_of(*part, *whole);
  expect_part_of(*part_finer, *whole_finer);
}

}  // namespace
}  // namespace tomofield::fit
