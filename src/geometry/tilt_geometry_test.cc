#include "geometry/tilt_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace tomofield::geometry {
namespace {

constexpr double kRoot2 = std::numbers::sqrt2;

TEST(TiltGeometry, PixelsAreCentredAtHalves) {
  // The middle of the view is width / 2 for even and odd sizes. In an odd view it is the centre of
  // the middle pixel.
  EXPECT_DOUBLE_EQ(centred_geometry(64, 8, 40, {0}).axis_x, 32.0);
  EXPECT_DOUBLE_EQ(centred_geometry(65, 8, 41, {0}).axis_x, 32.5);
  EXPECT_DOUBLE_EQ(centred_geometry(64, 8, 40, {0}).axis_z, 20.0);
  EXPECT_DOUBLE_EQ(centred_geometry(65, 8, 41, {0}).axis_z, 20.5);
}

TEST(TiltGeometry, DetectorXFollowsTheRightHandedRotation) {
  const auto g = centred_geometry(64, 8, 40, {0, 45, -45, 30});
  // The point is 10 px right of the axis and 6 px above it, towards the source.
  EXPECT_DOUBLE_EQ(g.detector_x(0, 42, 26), 42.0);
  EXPECT_DOUBLE_EQ(g.detector_x(1, 42, 26), 32 + (10 + 6) / kRoot2);
  EXPECT_DOUBLE_EQ(g.detector_x(2, 42, 26), 32 + (10 - 6) / kRoot2);
  EXPECT_DOUBLE_EQ(g.detector_x(3, 42, 26), 32 + 10 * std::sqrt(0.75) + 3);
}

TEST(TiltGeometry, TheOtherHandMirrorsZ) {
  auto g = centred_geometry(65, 8, 41, {37});
  const double right_handed = g.detector_x(0, 50.25, 33.5);
  g.hand = -1;
  EXPECT_DOUBLE_EQ(g.detector_x(0, 50.25, 41 - 33.5), right_handed);
  EXPECT_GT(std::abs(g.detector_x(0, 50.25, 33.5) - right_handed), 10.0);
}

TEST(TiltGeometry, AGivenCentreStaysWhereItIs) {
  auto g = centred_geometry(64, 8, 40, {-60, 0, 17, 60});
  g.axis_x = 35.25;
  g.axis_z = 12.5;
  for (int v = 0; v < g.num_views(); ++v) {
    EXPECT_DOUBLE_EQ(g.detector_x(v, 35.25, 12.5), 35.25);
    EXPECT_DOUBLE_EQ(g.detector_x(v, 36.25, 12.5), 35.25 + g.cos_tilt(v));
  }
}

TEST(TiltGeometry, RaysInvertDetectorX) {
  for (const int hand : {1, -1}) {
    for (const std::int64_t width : {64, 65}) {
      auto g = centred_geometry(width, 8, 33.5, {-80, -45, -12, 0, 3, 45, 71.57, 80});
      g.hand = hand;
      g.axis_x += 2.75;
      g.axis_z -= 1.25;
      for (int v = 0; v < g.num_views(); ++v) {
        for (const double u : {0.5, 13.25, 70.0}) {
          for (const double at : {-7.0, 0.0, 20.5}) {
            EXPECT_NEAR(g.detector_x(v, g.ray_x(v, u, at), at), u, 1e-11);
            if (g.tilt_deg[static_cast<std::size_t>(v)] != 0) {
              EXPECT_NEAR(g.detector_x(v, at, g.ray_z(v, u, at)), u, 1e-11);
            }
          }
        }
      }
    }
  }
}

TEST(TiltGeometry, RowsServeUpTo45DegreesColumnsBeyond) {
  const auto g = centred_geometry(8, 8, 8, {0, 45, -45, 45.001, -45.001, 80});
  for (int v = 0; v < 3; ++v) EXPECT_TRUE(g.is_flat(v)) << g.tilt_deg[static_cast<std::size_t>(v)];
  for (int v = 3; v < 6; ++v) EXPECT_FALSE(g.is_flat(v)) << g.tilt_deg[static_cast<std::size_t>(v)];
}

TEST(TiltGeometry, ReachIsHalfWidthOverCosinePlusHalfThicknessTimesTangent) {
  for (const double largest : {0.0, 30.0, 60.0, 70.0, 80.0}) {
    // Only one view is as steep as this, so it determines the reach on both sides.
    const auto g = centred_geometry(65, 8, 41, {-largest, 0, largest / 2});
    const double angle = largest * std::numbers::pi / 180;
    const double half_width = 32.5 / std::cos(angle) + 20.5 * std::tan(angle);
    EXPECT_NEAR(g.reach().low, 32.5 - half_width, 1e-9) << largest;
    EXPECT_NEAR(g.reach().high, 32.5 + half_width, 1e-9) << largest;
  }
}

TEST(TiltGeometry, ReachHoldsEveryRayOfAnOffCentreSeries) {
  auto g = centred_geometry(64, 8, 40, {-57, 0, 63});
  g.hand = -1;
  g.axis_x = 20;
  g.axis_z = 31;
  const auto reach = g.reach();
  double low = 0, high = 64;
  for (int v = 0; v < g.num_views(); ++v) {
    for (double u = 0; u <= 64; u += 0.5) {
      for (double z = 0; z <= 40; z += 0.5) {
        low = std::min(low, g.ray_x(v, u, z));
        high = std::max(high, g.ray_x(v, u, z));
      }
    }
  }
  EXPECT_DOUBLE_EQ(reach.low, low);
  EXPECT_DOUBLE_EQ(reach.high, high);
}

}  // namespace
}  // namespace tomofield::geometry
