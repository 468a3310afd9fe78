#include "measurement/noise_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace tomofield::measurement {
namespace {

constexpr double kRays = 1000;

// Returns the sums of views of which the residuals have these variances.
std::vector<ViewSums> sums_of(const std::vector<double>& variances) {
  std::vector<ViewSums> sums;
  for (const double variance : variances)
    sums.push_back({.n = kRays, .limited_squares = kRays * variance});
  return sums;
}

std::vector<ViewModel> models_of(const std::vector<double>& noise_weight) {
  std::vector<ViewModel> models;
  for (const double weight : noise_weight) models.push_back({1.1, 0.2, weight});
  return models;
}

TEST(NoiseFit, WeightsAreThoseOfTheMeasuredNoiseIfResidualsAgree) {
  const std::vector<double> noise_weight{4.0, 1.0, 0.25};
  auto models = models_of(noise_weight);
  const auto sums = sums_of({0.9 / 4.0, 0.9, 0.9 / 0.25});
  fit_noise(noise_weight, std::vector{0, 1, 2}, sums, models);
  for (std::size_t v = 0; v < models.size(); ++v) {
    EXPECT_NEAR(models[v].weight, noise_weight[v], 1e-6);
    EXPECT_NEAR(models[v].largest_residual, 4 / std::sqrt(noise_weight[v]), 1e-6);
    EXPECT_EQ(models[v].scale, 1.1);
    EXPECT_EQ(models[v].offset, 0.2);
  }
}

TEST(NoiseFit, AViewThatIsPredictedFarWorseThanOthersCountsLess) {
  const std::vector<double> noise_weight(5, 2.0);
  auto models = models_of(noise_weight);
  fit_noise(noise_weight, std::vector{0, 1, 2, 3, 4}, sums_of({0.5, 0.5, 0.8, 2.0, 0.1}), models);
  EXPECT_EQ(models[2].weight, models[0].weight);  // steep views of a sound series are like this
  EXPECT_NEAR(models[3].weight / models[0].weight, std::pow(1.75 / 4, 2), 1e-6);
  EXPECT_EQ(models[4].weight, models[0].weight);  // a small residual gives no more than the usual
  double total = 0;
  for (const ViewModel& model : models) total += model.weight;
  EXPECT_NEAR(total, 5 * 2.0, 1e-9);  // priors keep their strength
}

TEST(NoiseFit, EveryViewKeepsATenthOfItsWeight) {
  const std::vector<double> noise_weight(3, 1.0);
  auto models = models_of(noise_weight);
  fit_noise(noise_weight, std::vector{0, 1, 2}, sums_of({1.0, 1.0, 1e6}), models);
  EXPECT_NEAR(models[2].weight / models[0].weight, 0.1, 1e-9);
}

TEST(NoiseFit, LimitsRiseWhereTheResidualIsMoreThanNoise) {
  const std::vector<double> noise_weight(3, 4.0);  // σ = ½
  auto models = models_of(noise_weight);
  fit_noise(noise_weight, std::vector{0, 1, 2}, sums_of({0.1, 0.25, 25.0}), models);
  EXPECT_NEAR(models[0].largest_residual, 2.0, 1e-9);
  EXPECT_NEAR(models[1].largest_residual, 2.0, 1e-9);
  EXPECT_NEAR(models[2].largest_residual, 4 * 25.0 / 0.5, 1e-9);
}

TEST(NoiseFit, ViewsThatAreHeldOutOrHaveNoRaysKeepTheirModels) {
  const std::vector<double> noise_weight(4, 1.0);
  auto models = models_of(noise_weight);
  auto sums = sums_of({1.0, 9.0, 1.0, 1.0});
  sums[2] = {};
  fit_noise(noise_weight, std::vector{0, 2, 3}, sums, models);
  for (const std::size_t v : {1, 2}) {
    EXPECT_EQ(models[v].weight, 1.0);
    EXPECT_EQ(models[v].largest_residual, std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(models[0].weight, 1.0);
  fit_noise(noise_weight, std::vector{2}, sums, models);
  EXPECT_EQ(models[2].weight, 1.0);
}

TEST(NoiseFit, ViewsWithoutAnyResidualKeepTheirWeights) {
  const std::vector<double> noise_weight(2, 3.0);
  auto models = models_of(noise_weight);
  fit_noise(noise_weight, std::vector{0, 1}, sums_of({0.0, 0.0}), models);
  for (const ViewModel& model : models) EXPECT_NEAR(model.weight, 3.0, 1e-12);
}

}  // namespace
}  // namespace tomofield::measurement
