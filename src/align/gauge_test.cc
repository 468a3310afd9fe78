#include "align/gauge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::alignment {
namespace {

using geometry::TiltGeometry;
using geometry::ViewCorrection;

TiltGeometry geometry_of(std::vector<double> tilt_deg, int hand) {
  TiltGeometry geometry = geometry::centred_geometry(64, 64, 20, std::move(tilt_deg));
  geometry.hand = hand;
  return geometry;
}

// Returns tilts that are not symmetric about zero, in no order.
std::vector<double> some_tilts() { return {0, 3, -3, 6, -6, 15, 24, -24, 33, 42, 51, 60}; }

std::vector<ViewCorrection> random_corrections(std::size_t count) {
  base::Random random(4);
  std::vector<ViewCorrection> corrections(count);
  for (ViewCorrection& c : corrections)
    c = {random.normal(), random.normal(), 0.02 * random.normal(), 0.003 * random.normal(),
         0.5 * random.normal()};
  return corrections;
}

class Gauge : public ::testing::TestWithParam<int> {
 protected:
  const TiltGeometry geometry_ = geometry_of(some_tilts(), GetParam());
};
INSTANTIATE_TEST_SUITE_P(Hands, Gauge, ::testing::Values(1, -1),
                         [](const auto& hand) { return hand.param > 0 ? "right" : "left"; });

// Returns the corrections by which the views of a specimen move when it is moved, turned and
// enlarged.
std::vector<ViewCorrection> of_moved_specimen(const TiltGeometry& geometry) {
  std::vector<ViewCorrection> corrections;
  for (const double tilt_deg : geometry.tilt_deg) {
    const double tilt = tilt_deg * std::numbers::pi / 180;
    corrections.push_back(
        {.shift_x_px = 3.5 * std::cos(tilt) - geometry.hand * 12.25 * std::sin(tilt),
         .shift_y_px = -8.0,
         .log_magnification = 0.04,
         .tilt_deg = 2.5});
  }
  return corrections;
}

void expect_near(const ViewCorrection& found, const ViewCorrection& expected, double tolerance) {
  EXPECT_NEAR(found.shift_x_px, expected.shift_x_px, tolerance);
  EXPECT_NEAR(found.shift_y_px, expected.shift_y_px, tolerance);
  EXPECT_NEAR(found.rotation_rad, expected.rotation_rad, tolerance);
  EXPECT_NEAR(found.log_magnification, expected.log_magnification, tolerance);
  EXPECT_NEAR(found.tilt_deg, expected.tilt_deg, tolerance);
}

TEST_P(Gauge, AMovedSpecimenNeedsNoCorrections) {
  std::vector<ViewCorrection> corrections = of_moved_specimen(geometry_);
  remove_gauge(geometry_, corrections);
  for (const ViewCorrection& c : corrections) expect_near(c, {}, 1e-6);
}

TEST_P(Gauge, ASpecimensMoveDoesNotChangeTheResult) {
  std::vector<ViewCorrection> plain = random_corrections(geometry_.tilt_deg.size());
  std::vector<ViewCorrection> moved = plain;
  const std::vector<ViewCorrection> moves = of_moved_specimen(geometry_);
  for (std::size_t v = 0; v < moved.size(); ++v) {
    moved[v].shift_x_px += moves[v].shift_x_px;
    moved[v].shift_y_px += moves[v].shift_y_px;
    moved[v].log_magnification += moves[v].log_magnification;
    moved[v].tilt_deg += moves[v].tilt_deg;
  }
  remove_gauge(geometry_, plain);
  remove_gauge(geometry_, moved);
  for (std::size_t v = 0; v < moved.size(); ++v) expect_near(moved[v], plain[v], 1e-6);
}

TEST_P(Gauge, TheRestIsOrthogonalAndStays) {
  std::vector<ViewCorrection> corrections = random_corrections(geometry_.tilt_deg.size());
  remove_gauge(geometry_, corrections);
  double along_x = 0, along_z = 0, y = 0, tilt = 0, cubic = 0, magnification = 0, size = 0;
  for (std::size_t v = 0; v < corrections.size(); ++v) {
    const double angle = geometry_.tilt_deg[v] * std::numbers::pi / 180;
    along_x += corrections[v].shift_x_px * std::cos(angle);
    along_z += corrections[v].shift_x_px * std::sin(angle);
    y += corrections[v].shift_y_px;
    tilt += corrections[v].tilt_deg;
    cubic += corrections[v].tilt_deg * std::pow(angle, 3);
    magnification += corrections[v].log_magnification;
    size += std::abs(corrections[v].shift_x_px);
  }
  EXPECT_GT(size, 3.0);
  for (const double sum : {along_x, along_z, y, tilt, cubic, magnification})
    EXPECT_NEAR(sum, 0.0, 1e-9);
  const std::vector<ViewCorrection> once = corrections;
  remove_gauge(geometry_, corrections);
  for (std::size_t v = 0; v < once.size(); ++v) expect_near(corrections[v], once[v], 1e-9);
}

TEST_P(Gauge, RotationsStay) {
  std::vector<ViewCorrection> corrections(geometry_.tilt_deg.size(), {.rotation_rad = 0.05});
  remove_gauge(geometry_, corrections);
  for (const ViewCorrection& c : corrections) expect_near(c, {.rotation_rad = 0.05}, 0.0);
}

TEST(Gauge, ViewsOfOneTiltLoseTheirMeanShift) {
  for (const double tilt : {0.0, 20.0}) {
    const TiltGeometry geometry = geometry_of({tilt, tilt, tilt}, 1);
    std::vector<ViewCorrection> corrections{
        {.shift_x_px = 5}, {.shift_x_px = 8}, {.shift_x_px = 11}};
    remove_gauge(geometry, corrections);
    for (std::size_t v = 0; v < 3; ++v)
      expect_near(corrections[v], {.shift_x_px = 3.0 * static_cast<double>(v) - 3.0}, 1e-6);
  }
}

}  // namespace
}  // namespace tomofield::alignment
