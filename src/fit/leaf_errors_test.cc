#include "fit/leaf_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "base/parallel.h"

namespace tomofield::fit {
namespace {

using field::LeafShape;
using field::Region;

constexpr LeafShape kShape{.nx = 3, .ny = 3, .nz = 3};

// Two leaves of interest and one of the margin: flat, a ramp of ±1 along x, and noise.
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

}  // namespace
}  // namespace tomofield::fit
