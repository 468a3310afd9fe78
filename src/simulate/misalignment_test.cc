#include "simulate/misalignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "geometry/raw_from_aligned.h"

namespace tomofield::simulate {
namespace {

using geometry::RawFromAligned;
using geometry::ViewWarp;

double rotation_deg(const RawFromAligned& map) {
  return std::atan2(map.m21, map.m11) * 180.0 / std::numbers::pi;
}

double magnification(const RawFromAligned& map) { return std::hypot(map.m11, map.m21); }

TEST(Misalignment, ShiftsAloneAreThousandthsWithoutARotation) {
  for (const RawFromAligned& map : draw_maps({.shift_spread_px = 2.0}, 5, 30)) {
    EXPECT_EQ(map.m11, 1.0);
    EXPECT_EQ(map.m12, 0.0);
    EXPECT_NEAR(map.shift_x_px * 1000.0, std::round(map.shift_x_px * 1000.0), 1e-9);
  }
}

TEST(Misalignment, SpreadsAreStandardDeviations) {
  const std::size_t count = 4000;
  const auto maps = draw_maps({.shift_spread_px = 3.0,
                               .rotation_spread_deg = 0.5,
                               .magnification_spread = 0.01,
                               .axis_deg = -7.0},
                              3, count);
  double x = 0.0, rotation = 0.0, rotation_mean = 0.0, size = 0.0;
  for (const RawFromAligned& map : maps) {
    x += map.shift_x_px * map.shift_x_px / count;
    rotation_mean += rotation_deg(map) / count;
    rotation += std::pow(rotation_deg(map) + 7.0, 2) / count;
    size += std::pow(std::log(magnification(map)), 2) / count;
  }
  EXPECT_NEAR(std::sqrt(x), 3.0, 0.1);
  EXPECT_NEAR(rotation_mean, -7.0, 0.03);
  EXPECT_NEAR(std::sqrt(rotation), 0.5, 0.02);
  EXPECT_NEAR(std::sqrt(size), 0.01, 0.0004);
}

TEST(Misalignment, RotationsKeepTheShiftsOfASeed) {
  const auto plain = draw_maps({.shift_spread_px = 3.0}, 3, 20);
  const auto turned = draw_maps({.shift_spread_px = 3.0, .rotation_spread_deg = 0.5}, 3, 20);
  for (std::size_t view = 0; view < 20; ++view) {
    // The shift of the .xf file is rounded, which is the shift turned back.
    EXPECT_NEAR(turned[view].shift_x_px, plain[view].shift_x_px, 0.001);
    EXPECT_NEAR(turned[view].shift_y_px, plain[view].shift_y_px, 0.001);
  }
}

TEST(Misalignment, AnXfFileTellsTheMapExactly) {
  const auto maps = draw_maps(
      {.shift_spread_px = 3.0, .rotation_spread_deg = 2.0, .magnification_spread = 0.01}, 3, 20);
  for (const RawFromAligned& map : maps) {
    const io::ImodTransform line = geometry::invert(map);
    for (const double entry : {line.a11, line.a12, line.a21, line.a22})
      EXPECT_NEAR(entry * 1e7, std::round(entry * 1e7), 1e-6);
    for (const double entry : {line.shift_x_px, line.shift_y_px})
      EXPECT_NEAR(entry * 1e3, std::round(entry * 1e3), 1e-8);
    EXPECT_NEAR(map.m11, map.m22, 1e-6);
    EXPECT_NEAR(map.m12, -map.m21, 1e-6);
  }
}

// Calls visit(x, y) on a grid over a view of 80 pixels that is finer than that of the code.
template <typename Visit>
void for_each_point(const Visit& visit) {
  for (int row = 0; row < 160; ++row) {
    for (int column = 0; column < 160; ++column)
      visit((column + 0.5) / 2.0 - 40.0, (row + 0.5) / 2.0 - 40.0);
  }
}

TEST(Misalignment, WarpsHaveTheirSizeAndNoRigidPart) {
  const auto warps = draw_warps(1.7, 80.0, 9, 40);
  double squares = 0.0, count = 0.0;
  for (const ViewWarp& warp : warps) {
    double x_sum = 0.0, y_sum = 0.0, along = 0.0, around = 0.0, spread = 0.0;
    for_each_point([&](double x, double y) {
      const auto d = warp.displacement(x, y);
      x_sum += d[0];
      y_sum += d[1];
      along += d[0] * x + d[1] * y;
      around += d[1] * x - d[0] * y;
      spread += x * x + y * y;
      squares += d[0] * d[0] + d[1] * d[1];
      count += 1.0;
    });
    EXPECT_NEAR(x_sum / 25600.0, 0.0, 0.002);
    EXPECT_NEAR(y_sum / 25600.0, 0.0, 0.002);
    EXPECT_NEAR(along / spread, 0.0, 2e-4);
    EXPECT_NEAR(around / spread, 0.0, 2e-4);
  }
  EXPECT_NEAR(std::sqrt(squares / count), 1.7, 0.005);
}

TEST(Misalignment, WarpsChangeSlowlyFromViewToView) {
  const auto warps = draw_warps(1.0, 80.0, 4, 400);
  double product = 0.0, squares = 0.0;
  for (std::size_t view = 1; view < warps.size(); ++view) {
    for (std::size_t node = 0; node < warps[view].nodes.size(); ++node) {
      product += warps[view].nodes[node][0] * warps[view - 1].nodes[node][0];
      squares += warps[view].nodes[node][0] * warps[view].nodes[node][0];
    }
  }
  EXPECT_NEAR(product / squares, 0.9, 0.02);
}

}  // namespace
}  // namespace tomofield::simulate
