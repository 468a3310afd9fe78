#include "fit/halo.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "prior/answer.h"
#include "random_arrays.h"

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

// Three columns of plain vertices, two leaves a row and band, of which the last row ends early.
struct AnsweredField {
  static constexpr int kThickness = 6, kNumRows = 101;
  static constexpr Rectangle kRoi{0, 0, 40, kNumRows};

  std::unique_ptr<field::Field> field = make();
  prior::Lattice lattice{*field, kRoi};

  static std::unique_ptr<field::Field> make() {
    const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 2, .rows = 4};
    field::Quadtree tree(roots, std::vector<field::Region>(8, field::Region::kInterest));
    tree.split_to_level(field::Region::kInterest, 1);
    std::vector<field::LeafShape> shapes(static_cast<std::size_t>(tree.num_leaves()),
                                         {.nx = 17, .ny = 17, .nz = kThickness});
    return make_field(FieldKind::kGrid, std::move(tree), kThickness, std::move(shapes));
  }
};

// Has what one of several processes knows of two volumes.
struct OfProcess {
  measurement::RowShare share;
  Range leaves;
  std::vector<float> smooth, light;
  Halo halo;

  OfProcess(const AnsweredField& whole, int rank, int size)
      : share(measurement::row_share(AnsweredField::kNumRows, 32, rank, size)),
        leaves(field::leaves_of_bands(whole.field->tree(), share.bands)),
        halo(*whole.field, share.without_help(), prior::kRowsBeyond - field::kPixelCentre,
             distributed::Communicator::alone()) {}

  // Returns the own leaves of a volume; what others own is no number.
  std::vector<float> own_part(const field::Field& field, std::span<const float> volume) const {
    std::vector<float> part(volume.size(), std::numeric_limits<float>::quiet_NaN());
    const auto first = static_cast<std::ptrdiff_t>(field.offset(leaves.begin)),
               end = static_cast<std::ptrdiff_t>(field.offset(leaves.end));
    std::copy(volume.begin() + first, volume.begin() + end, part.begin() + first);
    return part;
  }
};

// Does what the processes do together in Halo::refresh().
void refresh_all(std::vector<OfProcess>& processes, std::vector<float> OfProcess::*volume) {
  std::vector<distributed::Communicator::Halo> packed;
  for (OfProcess& process : processes) packed.push_back(process.halo.pack(process.*volume));
  for (std::size_t i = 1; i < packed.size(); ++i) {
    ASSERT_EQ(packed[i - 1].to_after.size(), packed[i].from_before.size());
    ASSERT_EQ(packed[i].to_before.size(), packed[i - 1].from_after.size());
    std::ranges::copy(packed[i - 1].to_after, packed[i].from_before.begin());
    std::ranges::copy(packed[i].to_before, packed[i - 1].from_after.begin());
  }
  for (OfProcess& process : processes) process.halo.unpack(process.*volume);
}

TEST(Share, EachProcessAnswersForItsLeavesWithTheBitsOfOneProcess) {
  const AnsweredField whole;
  const auto num_parameters = whole.field->num_parameters();
  const std::vector<float> smooth = testing::random_floats(num_parameters, 3),
                           light = testing::random_floats(num_parameters, 4);
  const Range all{0, AnsweredField::kNumRows};
  const float mean =
      prior::mean_density(whole.lattice, all, smooth, distributed::Communicator::alone());
  std::vector<float> expected = smooth;
  prior::replace_by_answer(prior::Network::trained(), whole.lattice, {all, mean}, expected, light);
  for (const int size : {2, 3, 4}) {
    std::vector<OfProcess> processes;
    for (int rank = 0; rank < size; ++rank) {
      processes.emplace_back(whole, rank, size);
      processes.back().smooth = processes.back().own_part(*whole.field, smooth);
      processes.back().light = processes.back().own_part(*whole.field, light);
    }
    refresh_all(processes, &OfProcess::smooth);
    refresh_all(processes, &OfProcess::light);
    for (OfProcess& process : processes) {
      prior::replace_by_answer(prior::Network::trained(), whole.lattice,
                               {whole.lattice.rows_of(process.share.bands), mean}, process.smooth,
                               process.light);
      for (std::size_t i = whole.field->offset(process.leaves.begin);
           i < whole.field->offset(process.leaves.end); ++i)
        ASSERT_EQ(process.smooth[i], expected[i]) << size << " " << i;
    }
  }
}

// A process keeps the leaves of all rows that the learned prior reads beyond its bands.
TEST(Share, LeavesOfAllRowsThatTheLearnedPriorReadsAreKept) {
  EXPECT_EQ(rows_beyond(Prior::kTv), 1);
  const AnsweredField whole;
  const field::Quadtree& tree = whole.field->tree();
  const std::vector<int> kept = needed_leaves(tree, share_of({1, 2}), rows_beyond(Prior::kLearned));
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    EXPECT_EQ(std::ranges::count(kept, leaf), tree.leaf(leaf).square.y0 < 96 ? 1 : 0) << leaf;
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
