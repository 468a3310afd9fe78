#include "fit/apply_edit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "random_arrays.h"

namespace tomofield::fit {
namespace {

using field::LeafShape;
using field::Region;

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
    adam.step(*field, leaves, gradient, 0.01);
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
