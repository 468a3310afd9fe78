#include "baseline/classical/wbp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <vector>

#include "kernels/lanes.h"

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

using kernels::kLanes;

// Bridges row `lane` alone. The other lanes count everywhere and hold 5.
std::vector<float> bridged(const std::vector<float>& row, const std::vector<bool>& counts,
                           int lane) {
  std::vector<float> rays(row.size() * kLanes, 5.0f);
  std::vector<std::uint16_t> mask(row.size(), 0xffff);
  for (std::size_t x = 0; x < row.size(); ++x) {
    rays[x * kLanes + static_cast<std::size_t>(lane)] = row[x];
    if (!counts[x]) mask[x] = static_cast<std::uint16_t>(0xffff & ~(1 << lane));
  }
  bridge_gaps(mask.data(), static_cast<std::int64_t>(row.size()), rays.data());
  std::vector<float> result;
  for (std::size_t x = 0; x < row.size(); ++x) {
    for (int l = 0; l < kLanes; ++l) {
      const float ray = rays[x * kLanes + static_cast<std::size_t>(l)];
      if (l == lane) {
        result.push_back(ray);
      } else {
        EXPECT_EQ(ray, 5.0f);
      }
    }
  }
  return result;
}

TEST(BridgeGaps, StraightLinesInsideAndNothingAtTheEnds) {
  const std::vector<bool> counts = {false, true, false, false, true, true, false};
  EXPECT_EQ(bridged({99, 1, 99, 99, 7, 8, 99}, counts, 3),
            (std::vector<float>{0, 1, 3, 5, 7, 8, 0}));
}

TEST(BridgeGaps, ARowWithoutMeasurementsIsEmpty) {
  EXPECT_EQ(bridged({99, 99, 99}, {false, false, false}, 15), (std::vector<float>{0, 0, 0}));
}

TEST(BridgeGaps, MeasurementsStay) {
  EXPECT_EQ(bridged({3, -1, 4}, {true, true, true}, 0), (std::vector<float>{3, -1, 4}));
}

}  // namespace
}  // namespace tomofield::baseline
