#include "baseline/classical/sirt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/threads/parallel.h"
#include "kernels/lanes.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

SirtOptions options(int iterations) {
  SirtOptions result;
  result.iterations = iterations;
  return result;
}

Solution solve(const SphereSeries& series, const SirtOptions& options) {
  VoxelProblem problem = testing::voxel_problem(series);
  return reconstruct_sirt(problem, options, [](const IterationReport&, const VoxelVolume&) {});
}

class Sirt : public testing::OneThread {};

TEST_F(Sirt, FindsTheSpheres) {
  const Solution solution = solve(SphereSeries(), options(40));
  EXPECT_LT(testing::rms_error(solution.densities), 0.45 * testing::rms_truth());
}

TEST_F(Sirt, EveryIterationReducesTheObjective) {
  for (const bool non_negative : {true, false}) {
    SirtOptions o = options(30);
    o.non_negative = non_negative;
    const Solution solution = solve(SphereSeries(), o);
    ASSERT_EQ(solution.objective.size(), 31u);
    for (std::size_t i = 1; i < solution.objective.size(); ++i)
      EXPECT_LT(solution.objective[i], solution.objective[i - 1]) << i;
    EXPECT_LT(solution.data_loss.back(), 0.05 * solution.data_loss.front());
  }
}

TEST_F(Sirt, NonNegativityHoldsWhereItIsAskedFor) {
  SirtOptions o = options(20);
  EXPECT_GE(testing::lowest(solve(SphereSeries(), o).densities), 0.0f);
  o.non_negative = false;
  EXPECT_LT(testing::lowest(solve(SphereSeries(), o).densities), -0.01f);
}

TEST_F(Sirt, PixelsThatAreNoMeasurementsDoNotCount) {
  SphereSeries::Options hostile;
  hostile.masked_value = 1e6f;
  EXPECT_TRUE(testing::same_bits(solve(SphereSeries(), options(5)).densities,
                                 solve(SphereSeries(hostile), options(5)).densities));
}

TEST_F(Sirt, ViewsCountByTheirNoise) {
  // A view of pure noise is harmless if it is known to be noisy.
  SphereSeries::Options bad;
  bad.scale_of_view.assign(31, 1.0);
  bad.scale_of_view[15] = -5.0;
  SphereSeries series(bad);
  const double trusted = testing::rms_error(solve(series, options(40)).densities);
  series.noise_sigma[15] = 100;
  const double distrusted = testing::rms_error(solve(series, options(40)).densities);
  EXPECT_LT(distrusted, 0.7 * trusted);
  EXPECT_LT(distrusted, 0.45 * testing::rms_truth());
}

TEST_F(Sirt, ThreadsDoNotChangeABit) {
  base::set_thread_count(1);
  const Solution one = solve(SphereSeries(), options(5));
  base::set_thread_count(2);
  const Solution two = solve(SphereSeries(), options(5));
  EXPECT_TRUE(testing::same_bits(one.densities, two.densities));
  EXPECT_EQ(one.objective, two.objective);
}

TEST_F(Sirt, FittedScalesUndoTheGainsOfViews) {
  SphereSeries::Options gains;
  for (int view = 0; view < 31; ++view) gains.scale_of_view.push_back(view % 2 ? 0.9 : 1.1);
  const SphereSeries series(gains);
  SirtOptions o = options(30);
  const double without = solve(series, o).data_loss.back();
  VoxelProblem problem = testing::voxel_problem(series, {.fit_scale = true});
  const Solution solution =
      reconstruct_sirt(problem, o, [](const IterationReport&, const VoxelVolume&) {});
  EXPECT_LT(solution.data_loss.back(), 0.8 * without);
  EXPECT_NEAR(problem.view_model(14).scale / problem.view_model(15).scale, 1.1 / 0.9, 0.06);
}

TEST_F(Sirt, ViewsHeldOutDoNotCount) {
  SphereSeries::Options bad;
  bad.scale_of_view.assign(31, 1.0);
  bad.scale_of_view[15] = -5.0;
  const SphereSeries series, with_nonsense(bad);
  const auto held_out = [](const SphereSeries& s) {
    VoxelProblem problem = testing::voxel_problem(s, {.held_out = {2, 15}});
    EXPECT_EQ(problem.views().size(), 29u);
    return reconstruct_sirt(problem, options(5), [](const IterationReport&, const VoxelVolume&) {});
  };
  const Solution solution = held_out(series);
  EXPECT_TRUE(testing::same_bits(solution.densities, held_out(with_nonsense).densities));
  EXPECT_FALSE(testing::same_bits(solution.densities, solve(series, options(5)).densities));
}

TEST_F(Sirt, ReportsEveryIterationWithTheMetricsThatItBeganWith) {
  const SphereSeries series;
  VoxelProblem problem = testing::voxel_problem(series);
  std::vector<double> reported;
  const Solution solution =
      reconstruct_sirt(problem, options(4), [&](const IterationReport& report, const VoxelVolume&) {
        reported.push_back(report.data_loss);
        EXPECT_EQ(report.iteration, static_cast<int>(reported.size()));
      });
  ASSERT_EQ(reported.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(reported[i], solution.data_loss[i]);
}

}  // namespace
}  // namespace tomofield::baseline
