#include "baseline/classical/tilt_weights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

namespace tomofield::baseline {
namespace {

std::vector<double> degrees(const std::vector<double>& tilts) {
  std::vector<double> weights = tilt_weights(tilts);
  for (double& weight : weights) weight *= 180 / std::numbers::pi;
  return weights;
}

void expect_near(const std::vector<double>& found, const std::vector<double>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-9) << i;
}

TEST(TiltWeights, AreTheSpacingOfEvenTilts) {
  expect_near(degrees({-60, -57, -54, -51}), {3, 3, 3, 3});
}

TEST(TiltWeights, AreHalfTheDistancesToBothNeighboursInAnyOrder) {
  // The tilts in order are -20, -10, 0, 4, 20; the mean spacing is 10.
  expect_near(degrees({0, 4, -10, 20, -20}), {7, 10, 10, 13, 10});
}

TEST(TiltWeights, ViewsOfTheSameTiltShareIt) {
  expect_near(degrees({0, 0, 0, 12, -12}), {6, 0, 6, 9, 9});
}

TEST(TiltWeights, AddUpToTheHalfCircle) {
  std::vector<double> tilts;
  for (double tilt = -90; tilt < 90; tilt += 4) tilts.push_back(tilt);
  const auto sum = [](const std::vector<double>& w) {
    return std::accumulate(w.begin(), w.end(), 0.0);
  };
  EXPECT_NEAR(sum(tilt_weights(tilts)), std::numbers::pi, 1e-9);
  tilts.push_back(90);  // the view at 90° is the one at -90°
  EXPECT_NEAR(sum(tilt_weights(tilts)), std::numbers::pi, 1e-9);
}

}  // namespace
}  // namespace tomofield::baseline
