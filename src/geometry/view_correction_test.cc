#include "geometry/view_correction.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace tomofield::geometry {
namespace {

using Point = std::array<double, 2>;

constexpr std::array<Point, 4> kPoints{{{0, 0}, {100, 0}, {-37.5, 80.25}, {12, -250}}};
constexpr ViewCorrection kFirst{.shift_x_px = 3.25,
                                .shift_y_px = -7.5,
                                .rotation_rad = 0.3,
                                .log_magnification = 0.02,
                                .tilt_deg = 0.4};
constexpr ViewCorrection kSecond{.shift_x_px = -1.5,
                                 .shift_y_px = 20.0,
                                 .rotation_rad = -1.1,
                                 .log_magnification = -0.05,
                                 .tilt_deg = 1.25};

// Returns q' = exp(m) R(φ) q + shift, by the length and the angle of q.
Point found_at(const ViewCorrection& c, const Point& q) {
  const double radius = std::exp(c.log_magnification) * std::hypot(q[0], q[1]);
  const double angle = c.rotation_rad + std::atan2(q[1], q[0]);
  return {radius * std::cos(angle) + c.shift_x_px, radius * std::sin(angle) + c.shift_y_px};
}

Point found_at(const RawFromAligned& map, const Point& q) {
  return {map.m11 * q[0] + map.m12 * q[1] + map.shift_x_px,
          map.m21 * q[0] + map.m22 * q[1] + map.shift_y_px};
}

void expect_near(const Point& found, const Point& expected) {
  EXPECT_NEAR(found[0], expected[0], 1e-10);
  EXPECT_NEAR(found[1], expected[1], 1e-10);
}

TEST(ViewCorrection, ThenFindsAPointThroughBothMaps) {
  for (const Point& q : kPoints)
    expect_near(found_at(kFirst.then(kSecond), q), found_at(kFirst, found_at(kSecond, q)));
  EXPECT_DOUBLE_EQ(kFirst.then(kSecond).tilt_deg, 1.65);
}

TEST(ViewCorrection, NoneIsNeutral) {
  EXPECT_EQ(kFirst.then({}), kFirst);
  EXPECT_EQ(ViewCorrection{}.then(kFirst), kFirst);
}

TEST(ViewCorrection, CorrectedAlignmentFindsAPointThroughTheUncorrectedView) {
  // An alignment that swaps the axes, turns, shears and shifts.
  const RawFromAligned alignment{0.1, -0.97, 1.02, 0.05, 30.5, -4.25};
  for (const Point& q : kPoints)
    expect_near(found_at(corrected(alignment, kFirst), q),
                found_at(alignment, found_at(kFirst, q)));
  for (const Point& q : kPoints)
    expect_near(found_at(corrected(corrected(alignment, kFirst), kSecond), q),
                found_at(corrected(alignment, kFirst.then(kSecond)), q));
}

TEST(ViewCorrection, BinnedMapsBinnedPoints) {
  constexpr double kFactor = 2.5;
  for (const Point& q : kPoints) {
    const Point expected = found_at(kFirst, q);
    expect_near(found_at(kFirst.binned(kFactor), {q[0] / kFactor, q[1] / kFactor}),
                {expected[0] / kFactor, expected[1] / kFactor});
  }
  EXPECT_EQ(kFirst.binned(kFactor).tilt_deg, kFirst.tilt_deg);
}

}  // namespace
}  // namespace tomofield::geometry
