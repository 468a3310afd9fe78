#include "baseline/classical/variation_descent.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "base/random.h"
#include "geometry/tilt_geometry.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

constexpr std::int64_t kRows = 19;  // a slab and three rows

// Returns random densities. The margins have a spacing of 2.
VoxelVolume random_volume() {
  const auto geometry = geometry::centred_geometry(9, kRows, 6, {-40, 0, 40});
  VoxelVolume volume(projection::make_sample_grid(geometry, 0, 9, 2), kRows);
  base::Random random(4);
  for (int slab = 0; slab < volume.num_slabs(); ++slab) {
    for_each_sample_row(volume.grid(), [&](const auto& segment, std::ptrdiff_t row) {
      for (int i = 0; i < segment.nx; ++i) {
        for (int lane = 0; lane < volume.rows_in_slab(slab); ++lane)
          volume.slab(slab)[row + i * 16 + lane] = static_cast<float>(random.uniform(0.2, 1));
      }
    });
  }
  return volume;
}

double distance(const VoxelVolume& a, const VoxelVolume& b) {
  double sum = 0;
  for (int slab = 0; slab < a.num_slabs(); ++slab)
    sum += squared_distance(a.grid(), a.slab(slab), b.slab(slab));
  return std::sqrt(sum);
}

class VariationDescentTest : public testing::OneThread {};

TEST_F(VariationDescentTest, AStepIsAsLongAsItShallBe) {
  VoxelVolume volume = random_volume();
  VariationDescent(volume.grid(), kRows).step(0.3, false, volume);
  EXPECT_NEAR(distance(volume, random_volume()), 0.3, 1e-4);
}

TEST_F(VariationDescentTest, NoOtherDirectionFallsAsSteeply) {
  const auto fall_along = [](VoxelVolume& moved, double length) {
    VoxelVolume at = random_volume();
    VariationDescent descent(at.grid(), kRows);
    return (descent.step(0, false, at) - descent.step(0, false, moved)) / length;
  };
  const double length = 0.05;
  VoxelVolume steepest = random_volume();
  VariationDescent(steepest.grid(), kRows).step(length, false, steepest);
  const double fall = fall_along(steepest, length);
  EXPECT_GT(fall, 0);

  // The fall along another direction is the steepest fall times the cosine of the angle between
  // them.
  VoxelVolume tilted = random_volume();
  const VoxelVolume start = random_volume();
  base::Random random(8);
  double product = 0, squares = 0;
  for (int slab = 0; slab < tilted.num_slabs(); ++slab) {
    for_each_sample_row(tilted.grid(), [&](const auto& segment, std::ptrdiff_t row) {
      const double area = segment.hx * segment.hz;
      for (int i = 0; i < segment.nx; ++i) {
        for (int lane = 0; lane < tilted.rows_in_slab(slab); ++lane) {
          const std::ptrdiff_t at = row + i * 16 + lane;
          const double down =
              static_cast<double>(steepest.slab(slab)[at] - start.slab(slab)[at]) / length;
          const double along = down + 0.02 * random.normal();
          product += area * down * along;
          squares += area * along * along;
          tilted.slab(slab)[at] += static_cast<float>(length * along);
        }
      }
    });
  }
  const double cosine = product / std::sqrt(squares);
  ASSERT_LT(cosine, 0.9);
  EXPECT_NEAR(fall_along(tilted, length * std::sqrt(squares)) / fall, cosine, 0.02);
}

TEST_F(VariationDescentTest, StepsLeadToAConstant) {
  VoxelVolume volume = random_volume();
  VariationDescent descent(volume.grid(), kRows);
  const double first = descent.step(0.5, false, volume);
  double last = first;
  for (int i = 0; i < 400; ++i) last = descent.step(0.1, false, volume);
  EXPECT_LT(last, 0.1 * first);
}

TEST_F(VariationDescentTest, NonNegativityHoldsWhereItIsAskedFor) {
  VoxelVolume free = random_volume(), held = random_volume();
  VariationDescent descent(free.grid(), kRows);
  descent.step(60, false, free);
  descent.step(60, true, held);
  EXPECT_LT(testing::lowest(free), -0.1f);
  EXPECT_EQ(testing::lowest(held), 0.0f);
}

}  // namespace
}  // namespace tomofield::baseline
