#include "baseline/classical/sart_tv.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "base/random.h"
#include "baseline/classical/sirt.h"
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

using testing::SphereSeries;

const AfterIteration kNothing = [](const IterationReport&, const VoxelVolume&) {};

SartTvOptions options(int iterations, double weight) {
  SartTvOptions result;
  result.iterations = iterations;
  result.weight = weight;
  return result;
}

Solution solve(const SphereSeries& series, const SartTvOptions& options, double start = 0.1) {
  VoxelProblem problem = testing::voxel_problem(series);
  return reconstruct_sart_tv(problem, options, start, kNothing);
}

double variation(Solution solution) {
  VoxelVolume& densities = solution.densities;
  return VariationDescent(densities.grid(), densities.num_rows()).step(0, false, densities);
}

class SartTv : public testing::OneThread {};

TEST_F(SartTv, BetterThanSirt) {
  const SphereSeries series;
  VoxelProblem problem = testing::voxel_problem(series);
  SirtOptions sirt_options;
  sirt_options.iterations = 30;
  const Solution sirt = reconstruct_sirt(problem, sirt_options, kNothing);
  const Solution sart = solve(series, SartTvOptions());
  EXPECT_LT(testing::rms_error(sart.densities), 0.8 * testing::rms_error(sirt.densities));
}

TEST_F(SartTv, ResidualsFallWithThePasses) {
  const Solution solution = solve(SphereSeries(), options(20, 0.5));
  ASSERT_EQ(solution.data_loss.size(), 21u);
  for (std::size_t i = 1; i < 10; ++i)
    EXPECT_LT(solution.data_loss[i], solution.data_loss[i - 1]) << i;
  EXPECT_LT(solution.data_loss.back(), 0.05 * solution.data_loss.front());
}

TEST_F(SartTv, VariationFallsWithTheWeight) {
  const SphereSeries series;
  const double weak = variation(solve(series, options(20, 0.1)));
  const double some = variation(solve(series, options(20, 1)));
  const double strong = variation(solve(series, options(20, 3)));
  EXPECT_LT(some, 0.95 * weak);
  EXPECT_LT(strong, 0.95 * some);
}

TEST_F(SartTv, SubsetsGetFurtherInAPass) {
  const SphereSeries series;
  SartTvOptions whole = options(3, 0.1);
  whole.subsets = 1;
  EXPECT_LT(solve(series, options(3, 0.1)).data_loss.back(),
            0.7 * solve(series, whole).data_loss.back());
}

TEST_F(SartTv, OneSubsetAndHardlyAnyVariationIsSirt) {
  const SphereSeries series;
  SartTvOptions o = options(1, 1e-6);
  o.subsets = 1;
  VoxelProblem problem = testing::voxel_problem(series);
  SirtOptions sirt_options;
  sirt_options.iterations = 1;
  const Solution sirt = reconstruct_sirt(problem, sirt_options, kNothing);
  const Solution sart = solve(series, o, 0.0);
  double worst = 0;
  for (int slab = 0; slab < sirt.densities.num_slabs(); ++slab) {
    worst = std::max(worst, squared_distance(sirt.densities.grid(), sirt.densities.slab(slab),
                                             sart.densities.slab(slab)));
  }
  EXPECT_LT(std::sqrt(worst), 1e-3);
}

TEST_F(SartTv, ColumnSumsAreThoseOfRaysThatCount) {
  // Because C⁻¹ = Aᵀ W 1, ⟨C⁻¹, x⟩ = ⟨W, A x⟩ over the rays that count; here x = 1.
  const SphereSeries series;
  const VoxelProblem problem = testing::voxel_problem(series);
  const std::vector<int> views = {3, 12, 30};
  const std::size_t size = problem.projector().detector_size(views.size());
  base::AlignedBuffer<float> detector(size), weights(size), inverse(problem.grid().size());
  inverse_column_sums(problem, {0}, views, detector.data(), inverse.data());
  double columns = 0;
  for (const float value : std::span(inverse.data(), problem.grid().size()))
    columns += value > 0 ? 1 / static_cast<double>(value) : 0;
  problem.fill_weights(0, views, weights.data());
  double rows = 0;
  base::AlignedBuffer<float> ones(problem.grid().size()), rays(size);
  for_each_sample_row(problem.grid(), [&](const auto& segment, std::ptrdiff_t row) {
    std::fill_n(ones.data() + row, segment.nx * 16, 1.0f);
  });
  problem.projector().forward(ones.data(), views, rays.data());
  for (std::size_t i = 0; i + 16 < size; ++i)
    rows += static_cast<double>(weights.data()[i]) * static_cast<double>(rays.data()[i]);
  EXPECT_NEAR(columns, rows, 1e-4 * rows);
}

TEST_F(SartTv, NonNegativityHoldsWhereItIsAskedFor) {
  SartTvOptions o = options(5, 0.2);
  EXPECT_GE(testing::lowest(solve(SphereSeries(), o).densities), 0.0f);
  o.non_negative = false;
  EXPECT_LT(testing::lowest(solve(SphereSeries(), o).densities), -0.01f);
}

TEST_F(SartTv, PixelsThatAreNoMeasurementsDoNotCount) {
  SphereSeries::Options hostile;
  hostile.masked_value = 1e6f;
  EXPECT_TRUE(testing::same_bits(solve(SphereSeries(), options(3, 1)).densities,
                                 solve(SphereSeries(hostile), options(3, 1)).densities));
}

TEST_F(SartTv, ThreadsDoNotChangeABit) {
  base::set_thread_count(1);
  const Solution one = solve(SphereSeries(), options(3, 1));
  base::set_thread_count(2);
  const Solution two = solve(SphereSeries(), options(3, 1));
  EXPECT_TRUE(testing::same_bits(one.densities, two.densities));
  EXPECT_EQ(one.data_loss, two.data_loss);
}

}  // namespace
}  // namespace tomofield::baseline
