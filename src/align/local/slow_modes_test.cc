#include "align/local/slow_modes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace tomofield::alignment {
namespace {

// Returns a basis vector of the discrete cosine transform (DCT-II).
std::vector<double> cosine(int count, int mode) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i)
    values.push_back(std::cos(std::numbers::pi * (2 * i + 1) * mode / (2 * count)));
  return values;
}

// Returns the factor by which a cosine is amplified, and expects that it keeps its form.
double gain(int count, int mode) {
  const std::vector<double> before = cosine(count, mode);
  std::vector<double> after = before;
  amplify_slow_modes(after);
  const double factor = after[0] / before[0];
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_NEAR(after[i], factor * before[i], 1e-9) << count << " values, mode " << mode;
  return factor;
}

TEST(AmplifySlowModes, TriplesTheSlowOnesAndKeepsTheFastOnes) {
  for (const int count : {20, 41, 60}) {
    EXPECT_NEAR(gain(count, 0), 3.0, 1e-9);
    EXPECT_NEAR(gain(count, 1), 2.8, 0.05);
    for (int mode = 1; mode < count; ++mode)
      EXPECT_LT(gain(count, mode), gain(count, mode - 1) + 1e-9);
    for (int mode = 9; mode < count; ++mode) EXPECT_NEAR(gain(count, mode), 1.0, 1e-3);
  }
}

TEST(AmplifySlowModes, IsLinear) {
  const std::vector<double> a = cosine(30, 1), b = cosine(30, 20);
  std::vector<double> sum;
  for (std::size_t i = 0; i < a.size(); ++i) sum.push_back(2 * a[i] - 3 * b[i]);
  amplify_slow_modes(sum);
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_NEAR(sum[i], 2 * gain(30, 1) * a[i] - 3 * gain(30, 20) * b[i], 1e-9);
}

TEST(AmplifySlowModes, TakesFewViews) {
  std::vector<double> none, one{2.0};
  amplify_slow_modes(none);
  amplify_slow_modes(one);
  EXPECT_EQ(none.size(), 0u);
  EXPECT_NEAR(one[0], 6.0, 1e-12);
}

TEST(SlowModeAmplifier, AddsHalfAsMuchOnceAStepTurnsBack) {
  SlowModeAmplifier amplifier;
  const auto factor = [&](double size) {
    std::vector<double> step = cosine(30, 0);
    for (double& value : step) value *= size;
    amplifier.amplify(step);
    return step[4] / size;
  };
  EXPECT_NEAR(factor(1.0), 3.0, 1e-9);
  EXPECT_NEAR(factor(0.5), 3.0, 1e-9);
  EXPECT_NEAR(factor(-0.1), 3.0, 1e-9) << "it turns too little to tell";
  EXPECT_NEAR(factor(0.2), 2.0, 1e-9);
  EXPECT_NEAR(factor(0.3), 2.0, 1e-9);
  EXPECT_NEAR(factor(-0.3), 1.5, 1e-9);
}

// Returns the error that is left after some updates if a registration shows `shown` of it.
double error_left(double shown) {
  SlowModeAmplifier amplifier;
  double error = 1.0;
  for (int update = 0; update < 20; ++update) {
    std::vector<double> step = cosine(30, 0);
    for (double& value : step) value *= -1.3 * shown * error;
    amplifier.amplify(step);
    error += step[0];
  }
  return std::abs(error);
}

TEST(SlowModeAmplifier, UpdatesConvergeWhateverPartOfTheErrorIsShown) {
  for (const double shown : {0.2, 0.5, 0.8, 1.0}) EXPECT_LT(error_left(shown), 0.01) << shown;
}

}  // namespace
}  // namespace tomofield::alignment
