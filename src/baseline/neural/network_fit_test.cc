#include "baseline/neural/network_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "baseline/neural/network_methods.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

const std::vector<double> kCounts = {100, 400};
const std::vector<double> kSquares = {100 * 4.0, 400 * 0.09};  // the noise is 2 and 0.3

TEST(NoiseLevels, BecomeThoseOfTheResiduals) {
  NoiseLevels levels({1.0, 1.0});
  for (int i = 0; i < 200; ++i) levels.step(kCounts, kSquares, 0.1);
  EXPECT_NEAR(levels.sigma(0), 2.0, 1e-3);
  EXPECT_NEAR(levels.sigma(1), 0.3, 1e-3);
}

TEST(NoiseLevels, ObjectiveIsTheDataTermAtTheStartAndFalls) {
  NoiseLevels levels({1.0, 0.5});
  const double start = levels.objective(kCounts, kSquares);
  EXPECT_NEAR(start, 400 / 2.0 + 36 / 0.5, 1e-9);
  double last = start;
  for (int i = 0; i < 5; ++i) {
    levels.step(kCounts, kSquares, 0.1);
    EXPECT_LT(levels.objective(kCounts, kSquares), last);
    last = levels.objective(kCounts, kSquares);
  }
  // The objective is Σ squares / (2 σ²) + n log σ, less n log σ of the start.
  double expected = 0;
  for (std::size_t v = 0; v < 2; ++v) {
    const double sigma = levels.sigma(v), from = v == 0 ? 1.0 : 0.5;
    expected += kSquares[v] / (2 * sigma * sigma) + kCounts[v] * std::log(sigma / from);
  }
  EXPECT_NEAR(last, expected, 1e-9);
}

TEST(NoiseLevels, OfAViewWithoutResidualsStaysAsItWas) {
  NoiseLevels levels({1.0, 0.5});
  levels.step(std::vector<double>{0, 10}, std::vector<double>{0, 0}, 0.1);
  EXPECT_EQ(levels.sigma(0), 1.0);
  EXPECT_LT(levels.sigma(1), 0.5);
}

TEST(LazyAdam, FirstStepHasTheLengthOfTheRate) {
  LazyAdam adam(3);
  std::vector<float> parameters = {1, 1, 1};
  adam.gradient()[0] = 100;
  adam.gradient()[2] = -0.001f;
  adam.step(0.25, parameters);
  EXPECT_NEAR(parameters[0], 0.75, 1e-5);
  EXPECT_EQ(parameters[1], 1);
  EXPECT_NEAR(parameters[2], 1.25, 1e-5);
  for (const float g : adam.gradient()) EXPECT_EQ(g, 0);
}

TEST(LazyAdam, LeavesWhatHasNoGradientAloneWithItsMoments) {
  constexpr std::size_t kCount = 1000, kFar = 700;
  LazyAdam adam(kCount), other(kCount);
  std::vector<float> parameters(kCount), expected(kCount);
  const auto step = [&](LazyAdam& of, std::vector<float>& moved, std::size_t at) {
    of.gradient()[at] = 1.5f - moved[at];
    of.step(0.1, moved);
  };
  for (int i = 0; i < 5; ++i) {
    step(adam, parameters, 0);
    step(adam, parameters, kFar);  // must not change the parameters at 0
    step(other, expected, 0);
  }
  EXPECT_EQ(parameters[0], expected[0]);
  EXPECT_EQ(parameters[kFar], expected[0]);
  EXPECT_EQ(parameters[kFar - 100], 0);
}

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

FourierNetOptions fourier_net_options(int iterations) {
  FourierNetOptions options;
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

Solution solve(const SphereSeries& series, const FourierNetOptions& options) {
  VoxelProblem problem = testing::voxel_problem(series);
  return reconstruct_fourier_net(problem, options, kMeanDensity, kNothing);
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
  const Solution solution = solve(series, fourier_net_options(60));
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
  const Solution one = solve(SphereSeries(), fourier_net_options(2));
  base::set_thread_count(3);
  const Solution three = solve(SphereSeries(), fourier_net_options(2));
  EXPECT_TRUE(testing::same_bits(one.densities, three.densities));
  EXPECT_EQ(one.noise_sigma, three.noise_sigma);
  FourierNetOptions other = fourier_net_options(2);
  other.seed = 2;
  EXPECT_FALSE(testing::same_bits(one.densities, solve(SphereSeries(), other).densities));
}

}  // namespace
}  // namespace tomofield::baseline
