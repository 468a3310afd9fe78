#include "fit/tree_updates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/threads/parallel.h"
#include "random_arrays.h"

namespace tomofield::fit {
namespace {

using field::LeafShape;
using field::Region;

constexpr LeafShape kShape{.nx = 3, .ny = 3, .nz = 3};

// Makes a flat leaf and a ramp of ±1 along x in the region of interest, and noise in the margin.
std::unique_ptr<field::Field> ramp_field() {
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 3, .rows = 1};
  auto field = field::make_field(
      FieldKind::kGrid,
      field::Quadtree(roots, {Region::kInterest, Region::kInterest, Region::kMargin}), 10.0,
      {kShape, kShape, kShape});
  field->initialise(base::Random(1), 1.0);
  for (int leaf = 0; leaf < 2; ++leaf) {
    for (int x = 0; x < 3; ++x) {
      for (std::size_t zy = 0; zy < 9; ++zy)
        field->parameters()[field->offset(leaf) + static_cast<std::size_t>(x) * 9 + zy] =
            leaf == 0 ? 0.0f : static_cast<float>(x - 1);
    }
  }
  field->bias = 3.0f;
  return field;
}

TEST(LeafErrors, AreStandardDeviationsOfTheDensity) {
  const auto field = ramp_field();
  const auto errors = leaf_errors(*field, 1, 0);
  EXPECT_NEAR(errors[0], 0.0, 1e-6);
  EXPECT_NEAR(errors[1], 1 / std::sqrt(3.0), 0.003);  // of a uniform variable in ±1
  EXPECT_EQ(errors[2], 0.0) << "the margin is not measured";
}

TEST(LeafErrors, DependOnSeedPassAndPlaceAlone) {
  const auto field = ramp_field();
  base::set_thread_count(1);
  const auto one = leaf_errors(*field, 1, 0);
  base::set_thread_count(3);
  EXPECT_EQ(leaf_errors(*field, 1, 0), one);
  base::set_thread_count(0);
  EXPECT_NE(leaf_errors(*field, 2, 0)[1], one[1]);
  EXPECT_NE(leaf_errors(*field, 1, 1)[1], one[1]);
  // Splitting the other leaf changes leaf numbers, but not this one's points.
  field->edit({.split = {0}, .merge = {}});
  EXPECT_EQ(leaf_errors(*field, 1, 0)[4], one[1]);
}

std::unique_ptr<field::Field> four_leaves() {
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 2, .rows = 2};
  auto field = field::make_field(FieldKind::kGrid,
                                 field::Quadtree(roots, std::vector<Region>(4, Region::kInterest)),
                                 10.0, std::vector<LeafShape>(4, {.nx = 3, .ny = 3, .nz = 3}));
  field->initialise(base::Random(1), 1.0);
  return field;
}

TEST(ApplyEdit, CarriesTheOptimisersStateWithTheLeaves) {
  const auto field = four_leaves();
  Adam adam(*field, {});
  base::AlignedBuffer<float> gradient(field->num_parameters());
  const auto step = [&](const std::vector<int>& leaves) {
    gradient.reset(field->num_parameters());
    std::ranges::copy(testing::random_floats(gradient.size(), 3), gradient.begin());
    for (const int leaf : leaves) adam.step(*field, leaf, gradient, 0.01);
  };
  step({0, 1, 3});
  step({1});
  const auto& state = adam.state();
  const std::vector<float> kept(
      state.m.begin() + static_cast<std::ptrdiff_t>(field->offset(3)),
      state.m.begin() + static_cast<std::ptrdiff_t>(field->offset(3)) + 27);
  apply_edit({.split = {1}, .merge = {}}, *field, adam.state());
  EXPECT_EQ(state.leaf_steps, (std::vector<std::int64_t>{1, 2, 2, 2, 2, 0, 1}));
  EXPECT_EQ(state.m.size(), field->num_parameters());
  EXPECT_EQ(
      std::vector<float>(state.m.begin() + static_cast<std::ptrdiff_t>(field->offset(6)),
                         state.m.begin() + static_cast<std::ptrdiff_t>(field->offset(6)) + 27),
      kept);
  step({0, 1, 2, 4});  // sizes fit: the optimiser goes on
  apply_edit({.split = {}, .merge = {1}}, *field, adam.state());
  EXPECT_EQ(state.leaf_steps, (std::vector<std::int64_t>{2, 2, 0, 1}));
}

}  // namespace
}  // namespace tomofield::fit
