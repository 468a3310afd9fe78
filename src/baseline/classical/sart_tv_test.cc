#include "baseline/classical/sart_tv.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "baseline/classical/row_action.h"
#include "baseline/classical/sirt.h"
#include "baseline/classical/variation_descent.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

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
