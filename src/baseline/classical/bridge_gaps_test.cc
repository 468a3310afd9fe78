#include "baseline/classical/bridge_gaps.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

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
