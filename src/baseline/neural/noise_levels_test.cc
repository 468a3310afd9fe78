#include "baseline/neural/noise_levels.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

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

}  // namespace
}  // namespace tomofield::baseline
