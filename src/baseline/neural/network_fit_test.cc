#include "baseline/neural/network_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "baseline/neural/implicit.h"
#include "baseline/neural/ingp.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

const AfterIteration kNothing = [](const IterationReport&, const VoxelVolume&) {};
constexpr double kMeanDensity = 0.1;

class NetworkFit : public testing::OneThread {};

IngpOptions ingp_options(int iterations) {
  IngpOptions options;
  options.iterations = iterations;
  options.width = 16;
  options.grid = {.levels = 4, .coarsest = 8, .finest = 2, .table_bits = 12};
  return options;
}

ImplicitOptions implicit_options(int iterations) {
  ImplicitOptions options;
  options.iterations = iterations;
  options.hidden_layers = 2;
  options.width = 24;
  options.features = 40;
  options.learning_rate = 0.01;
  return options;
}

Solution solve(const SphereSeries& series, const IngpOptions& options) {
  VoxelProblem problem = testing::voxel_problem(series);
  return reconstruct_ingp(problem, options, kMeanDensity, kNothing);
}

Solution solve(const SphereSeries& series, const ImplicitOptions& options) {
  VoxelProblem problem = testing::voxel_problem(series);
  return reconstruct_implicit(problem, options, kMeanDensity, kNothing);
}

TEST_F(NetworkFit, HashGridFindsTheSpheres) {
  const Solution solution = solve(SphereSeries(), ingp_options(20));
  EXPECT_LT(testing::rms_error(solution.densities), 0.5 * testing::rms_truth());
  ASSERT_EQ(solution.data_loss.size(), 21u);
  EXPECT_LT(solution.data_loss.back(), 0.1 * solution.data_loss.front());
  EXPECT_GE(testing::lowest(solution.densities), 0.0f);
}

TEST_F(NetworkFit, CoordinateNetworkFindsTheSpheresAndLearnsTheNoise) {
  const SphereSeries series;
  const Solution solution = solve(series, implicit_options(60));
  EXPECT_LT(testing::rms_error(solution.densities), 0.6 * testing::rms_truth());
  ASSERT_EQ(solution.noise_sigma.size(), series.noise_sigma.size());
  // Each level is the root mean square residual of its view, so together they give the data loss.
  double squares = 0;
  for (const double sigma : solution.noise_sigma) squares += sigma * sigma / 31;
  const double known = std::pow(SphereSeries::Options().noise_sigma, 2);
  const double num_rays = static_cast<double>(testing::voxel_problem(series).num_rays());
  EXPECT_NEAR(squares / known, 2 * solution.data_loss.back() / num_rays, 0.05 * squares / known);
}

TEST_F(NetworkFit, DensitiesMayBeNegativeWhereThatIsAskedFor) {
  IngpOptions options = ingp_options(6);
  options.non_negative = false;
  EXPECT_LT(testing::lowest(solve(SphereSeries(), options).densities), -0.01f);
}

TEST_F(NetworkFit, ScalesOfViewsAreFitted) {
  SphereSeries::Options uneven;
  for (int view = 0; view < 31; ++view) uneven.scale_of_view.push_back(view % 2 == 0 ? 1.2 : 0.8);
  const SphereSeries series(uneven);
  VoxelProblem fitted = testing::voxel_problem(series, {.fit_scale = true});
  const Solution solution = reconstruct_ingp(fitted, ingp_options(20), kMeanDensity, kNothing);
  EXPECT_LT(solution.data_loss.back(), 0.8 * solve(series, ingp_options(20)).data_loss.back());
  EXPECT_GT(fitted.view_model(0).scale, 1.2 * fitted.view_model(1).scale);
}

TEST_F(NetworkFit, PixelsThatAreNoMeasurementsDoNotCount) {
  SphereSeries::Options hostile;
  hostile.masked_value = 1e6f;
  EXPECT_TRUE(testing::same_bits(solve(SphereSeries(), ingp_options(2)).densities,
                                 solve(SphereSeries(hostile), ingp_options(2)).densities));
}

TEST_F(NetworkFit, ThreadsDoNotChangeABitAndTheSeedDoes) {
  base::set_thread_count(1);
  const Solution one = solve(SphereSeries(), implicit_options(2));
  base::set_thread_count(3);
  const Solution three = solve(SphereSeries(), implicit_options(2));
  EXPECT_TRUE(testing::same_bits(one.densities, three.densities));
  EXPECT_EQ(one.noise_sigma, three.noise_sigma);
  ImplicitOptions other = implicit_options(2);
  other.seed = 2;
  EXPECT_FALSE(testing::same_bits(one.densities, solve(SphereSeries(), other).densities));
}

}  // namespace
}  // namespace tomofield::baseline
