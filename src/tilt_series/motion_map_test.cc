#include "tilt_series/motion_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "tilt_series/resampling/align_image.h"

namespace tomofield::tilt_series {
namespace {

using geometry::ViewWarp;

constexpr std::int64_t kWidth = 120, kHeight = 90;

ViewWarp random_warp(double amplitude) {
  base::Random random(3);
  ViewWarp warp{.width_px = kWidth, .height_px = kHeight};
  for (auto& node : warp.nodes) node = {amplitude * random.normal(), amplitude * random.normal()};
  return warp;
}

TEST(MotionMap, IsNearTheWarp) {
  const ViewWarp warp = random_warp(1.5);
  const MotionMap map(warp);
  for (double x = -58.0; x <= 58.0; x += 1.7) {
    for (double y = -43.0; y <= 43.0; y += 1.3) {
      const auto found = map.source_of(x, y), exact = warp.source_of(x, y);
      // At the edges the displacements have kinks.
      if (std::abs(exact[0]) > 58 || std::abs(exact[1]) > 43) continue;
      EXPECT_NEAR(found[0], exact[0], 0.01);
      EXPECT_NEAR(found[1], exact[1], 0.01);
    }
  }
}

double scene(double x, double y) { return std::sin(0.21 * x + 0.3) * std::cos(0.17 * y - 0.2); }

TEST(AlignImage, UndoesLocalMotion) {
  // The recorded view, which is shifted as well, shows at q what belongs at q + d(q).
  const ViewWarp warp = random_warp(1.0);
  const RawFromAligned map{.shift_x_px = 2.0, .shift_y_px = -1.0};
  MaskedImage raw(kWidth, kHeight);
  for (std::int64_t y = 0; y < kHeight; ++y) {
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const double qx = static_cast<double>(x) + 0.5 - kWidth / 2.0 - map.shift_x_px;
      const double qy = static_cast<double>(y) + 0.5 - kHeight / 2.0 - map.shift_y_px;
      const auto d = warp.displacement(qx, qy);
      raw.values[raw.index(x, y)] = static_cast<float>(scene(qx + d[0], qy + d[1]));
      raw.valid[raw.index(x, y)] = 1;
    }
  }
  const MaskedImage still = align_image(raw, map, kWidth, kHeight, warp);
  std::int64_t num_valid = 0;
  for (std::int64_t y = 0; y < kHeight; ++y) {
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const std::size_t at = still.index(x, y);
      if (still.valid[at] == 0) continue;
      ++num_valid;
      // At the edges of the raw image its mirror image has a kink.
      EXPECT_NEAR(still.values[at],
                  scene(static_cast<double>(x) + 0.5 - kWidth / 2.0,
                        static_cast<double>(y) + 0.5 - kHeight / 2.0),
                  0.02)
          << x << ", " << y;
    }
  }
  EXPECT_GT(num_valid, kWidth * kHeight * 9 / 10);
}

TEST(AlignImage, AMaskMovesWithTheView) {
  ViewWarp shifted{.width_px = kWidth, .height_px = kHeight};
  for (auto& node : shifted.nodes) node = {5.0, -3.0};
  MaskedImage raw(kWidth, kHeight);
  for (auto& valid : raw.valid) valid = 1;
  raw.valid[raw.index(40, 50)] = 0;
  const MaskedImage moved = align_image(raw, {}, kWidth, kHeight, shifted);
  EXPECT_EQ(moved.valid[moved.index(45, 47)], 0);
  EXPECT_EQ(moved.valid[moved.index(40, 50)], 1);
  EXPECT_EQ(moved.valid[moved.index(2, 20)], 0) << "it comes from beyond the edge";
}

}  // namespace
}  // namespace tomofield::tilt_series
