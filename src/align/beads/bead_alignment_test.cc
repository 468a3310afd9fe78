#include "align/beads/bead_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "align/gauge.h"
#include "base/random.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNoise_px = 0.15;

BeadGeometry tilted_views(double axis_px = 0.0) {
  BeadGeometry geometry;
  geometry.axis_px = axis_px;
  for (double tilt = -60; tilt <= 60; tilt += 3) geometry.tilt_deg.push_back(tilt);
  return geometry;
}

// Returns errors of an alignment that change slowly over the tilts.
std::vector<ViewCorrection> slow_errors(const BeadGeometry& geometry) {
  std::vector<ViewCorrection> errors;
  for (const double tilt_deg : geometry.tilt_deg) {
    const double part = tilt_deg / 60;
    errors.push_back({.shift_x_px = 0.4 * part * part * part,
                      .shift_y_px = 0.3 * part,
                      .rotation_rad = (0.2 + 0.1 * part * part) * kDegree,
                      .log_magnification = 0.001 * part});
  }
  return errors;
}

// Returns the spots of beads that are scattered over views of 400 pixels, as the errors show them.
std::vector<std::vector<BeadPoint>> scattered_beads(int num_beads, const BeadGeometry& geometry,
                                                    const std::vector<ViewCorrection>& errors) {
  base::Random random(7);
  std::vector<std::vector<BeadPoint>> beads;
  for (int bead = 0; bead < num_beads; ++bead) {
    const double x = 400 * random.uniform() - 200, y = 400 * random.uniform() - 200,
                 z = 60 * random.uniform() - 30;
    beads.emplace_back();
    for (std::size_t view = 0; view < errors.size(); ++view) {
      const double tilt = geometry.tilt_deg[view] * kDegree;
      const double place = geometry.axis_px + x * std::cos(tilt) + z * std::sin(tilt);
      const ViewCorrection shown =
          errors[view].then({.shift_x_px = place, .shift_y_px = y});  // moves the place as a view
      beads.back().push_back({view, shown.shift_x_px + kNoise_px * random.normal(),
                              shown.shift_y_px + kNoise_px * random.normal()});
    }
  }
  return beads;
}

// Returns the root mean squares of the errors that steps leave, without what beads cannot tell.
struct Left {
  double shift_px = 0.0, rotation_deg = 0.0, magnification = 0.0;
};
Left left_by(const std::vector<ViewCorrection>& steps, const std::vector<ViewCorrection>& errors,
             const BeadGeometry& geometry) {
  std::vector<ViewCorrection> left = steps;
  for (std::size_t view = 0; view < left.size(); ++view) {
    left[view].shift_x_px -= errors[view].shift_x_px;
    left[view].shift_y_px -= errors[view].shift_y_px;
    left[view].rotation_rad -= errors[view].rotation_rad;
    left[view].log_magnification -= errors[view].log_magnification;
  }
  remove_gauge(geometry::centred_geometry(400, 400, 60, geometry.tilt_deg), left);
  Left sums;
  for (const ViewCorrection& view : left) {
    sums.shift_px += (std::pow(view.shift_x_px, 2) + std::pow(view.shift_y_px, 2)) / 2;
    sums.rotation_deg += std::pow(view.rotation_rad / kDegree, 2);
    sums.magnification += std::pow(view.log_magnification, 2);
  }
  const auto root = [&](double sum) { return std::sqrt(sum / static_cast<double>(left.size())); };
  return {root(sums.shift_px), root(sums.rotation_deg), root(sums.magnification)};
}

std::optional<BeadAlignment> fit(const std::vector<std::vector<BeadPoint>>& beads,
                                 const BeadGeometry& geometry, const Freedoms& freedoms) {
  return fit_beads(beads, std::vector<ViewCorrection>(geometry.tilt_deg.size()), geometry,
                   freedoms);
}

constexpr Freedoms kAll{.rotation = true, .magnification = true};

TEST(BeadAlignment, FindsSlowErrors) {
  const BeadGeometry geometry = tilted_views();
  const std::vector<ViewCorrection> errors = slow_errors(geometry);
  const auto found = fit(scattered_beads(10, geometry, errors), geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->is_accepted);
  EXPECT_EQ(found->num_beads, 10u);
  EXPECT_NEAR(found->after_px, kNoise_px, 0.1 * kNoise_px);
  EXPECT_GT(found->before_px, 1.5 * kNoise_px);
  const Left before = left_by(std::vector<ViewCorrection>(errors.size()), errors, geometry);
  const Left after = left_by(found->steps, errors, geometry);
  EXPECT_LT(after.shift_px, 0.25 * before.shift_px);
  EXPECT_LT(after.rotation_deg, 0.15 * before.rotation_deg);
  EXPECT_LT(after.magnification, 0.3 * before.magnification);
}

TEST(BeadAlignment, KnowsWhereTheTiltAxisIs) {
  const BeadGeometry geometry = tilted_views(35.0);
  const std::vector<ViewCorrection> none(geometry.tilt_deg.size());
  const auto beads = scattered_beads(10, geometry, none);
  const auto found = fit(beads, geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->before_px, kNoise_px, 0.1 * kNoise_px);
  EXPECT_GT(fit(beads, tilted_views(0.0), kAll)->before_px, 5 * kNoise_px);
}

TEST(BeadAlignment, IsSparedFromSomeWrongSpots) {
  const BeadGeometry geometry = tilted_views();
  const std::vector<ViewCorrection> errors = slow_errors(geometry);
  auto beads = scattered_beads(10, geometry, errors);
  for (std::size_t i = 0; i < beads.size(); ++i) beads[i][5 * i % 41].y_px += 4.0;
  const auto found = fit(beads, geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_LT(left_by(found->steps, errors, geometry).rotation_deg, 0.03);
}

TEST(BeadAlignment, LeavesMagnificationsThatAreNotFree) {
  const BeadGeometry geometry = tilted_views();
  const auto found =
      fit(scattered_beads(10, geometry, slow_errors(geometry)), geometry, {.rotation = true});
  ASSERT_TRUE(found);
  for (const ViewCorrection& step : found->steps) EXPECT_EQ(step.log_magnification, 0.0);
}

TEST(BeadAlignment, LeavesViewsThatAreAlignedWell) {
  const BeadGeometry geometry = tilted_views();
  const std::vector<ViewCorrection> none(geometry.tilt_deg.size());
  const auto found = fit(scattered_beads(5, geometry, none), geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->is_accepted) << found->gain.mean << " ± " << found->gain.error;
}

TEST(BeadAlignment, KnowsHowFarBeadsLieWithTheAlignmentOfTheFiles) {
  const BeadGeometry geometry = tilted_views();
  std::vector<ViewCorrection> corrections = slow_errors(geometry);
  const std::vector<ViewCorrection> none(corrections.size());
  const auto shown_right = scattered_beads(10, geometry, none);
  const auto found = fit_beads(shown_right, corrections, geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->before_px, kNoise_px, 0.1 * kNoise_px);
  // In the files, the spots are where errors show them.
  const auto in_files = fit(scattered_beads(10, geometry, corrections), geometry, kAll);
  EXPECT_NEAR(found->files_px, in_files->before_px, 0.1 * in_files->before_px);
}

TEST(BeadAlignment, MeasuresEveryDistanceInTheSameWay) {
  const BeadGeometry geometry = tilted_views();
  const std::vector<ViewCorrection> none(geometry.tilt_deg.size());
  auto beads = scattered_beads(10, geometry, none);
  for (std::size_t i = 0; i < beads.size(); ++i) beads[i][5 * i % 41].y_px += 8.0;  // outliers
  const auto found = fit(beads, geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->files_px, found->before_px);
}

TEST(BeadAlignment, TheFilesHaveTheirOwnTiltAngles) {
  BeadGeometry geometry = tilted_views();
  std::vector<ViewCorrection> corrections(geometry.tilt_deg.size());
  const auto beads = scattered_beads(10, geometry, corrections);
  for (std::size_t view = 0; view < corrections.size(); ++view) {
    corrections[view].tilt_deg = view % 2 == 0 ? 1.0 : -1.0;
    geometry.tilt_deg[view] += corrections[view].tilt_deg;
  }
  const auto found = fit_beads(beads, corrections, geometry, kAll);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->files_px, kNoise_px, 0.1 * kNoise_px);
  EXPECT_GT(found->before_px, 3 * kNoise_px);
}

TEST(BeadAlignment, NeedsThreeBeads) {
  const BeadGeometry geometry = tilted_views();
  const auto beads = scattered_beads(2, geometry, slow_errors(geometry));
  EXPECT_FALSE(fit(beads, geometry, kAll));
}

}  // namespace
}  // namespace tomofield::alignment
