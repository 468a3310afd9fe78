#include "tilt_series/local/local_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tomofield::tilt_series {
namespace {

constexpr double kViewWidth = 120, kViewHeight = 90;

// Local alignments on 2 × 2 parts of two sections, whose second one is moved.
io::ImodLocal some_local() {
  io::ImodLocal local{.columns = 2,
                      .rows = 2,
                      .first_x_px = 20.5,
                      .first_y_px = 15.5,
                      .step_x_px = 80,
                      .step_y_px = 60,
                      .num_sections = 2};
  local.parts.resize(8);
  return local;
}

TEST(LocalAlignment, AWarpUndoesWhatTheOtherProgramSays) {
  const LocalPlace place = [](double x, double y) {
    return geometry::ViewWarp::Vector{x + 2.0 + 0.02 * y, y - 1.0 + 0.01 * x};
  };
  const FittedWarp fitted = warp_through(kViewWidth, kViewHeight, place);
  // The pixel at p shows what belongs at p + d(p), so place(p + d(p)) = p.
  for (const auto& [x, y] : {std::pair{-50.0, 40.0}, std::pair{13.0, -7.0}}) {
    const auto d = fitted.warp.displacement(x, y);
    const auto p = place(x + d[0], y + d[1]);
    EXPECT_NEAR(p[0], x, 1e-6);
    EXPECT_NEAR(p[1], y, 1e-6);
  }
  EXPECT_LT(fitted.left_over_px, 1e-6);  // the spline holds what is linear
  EXPECT_NEAR(fitted.rms_px, std::sqrt(fitted.warp.mean_square()), 1e-12);
}

TEST(LocalAlignment, PatchesOfAreTomoAreWeighedByTheirDistance) {
  const std::vector<io::AreTomoPatch> patches{{-30, 0, 1.0, 0.0}, {30, 0, 0.0, 2.0}};
  const LocalPlace place = place_of_aretomo(patches, 90.0, kViewWidth, kViewHeight);
  // R(90°) turns (0, -30) into (30, 0), which is the place of the second patch.
  const double weight = std::exp(-100.0 * std::pow(60 / kViewWidth, 2));
  const double lx = weight / (1 + weight), ly = 2 / (1 + weight);
  const auto p = place(0, -30);
  // The shift is in the raw image and is turned back: (lx, ly) becomes (ly, -lx).
  EXPECT_NEAR(p[0], ly, 1e-12);
  EXPECT_NEAR(p[1], -30 - lx, 1e-12);
  const auto alone = place_of_aretomo({}, 90.0, kViewWidth, kViewHeight)(3, 4);
  EXPECT_EQ(alone, (geometry::ViewWarp::Vector{3, 4}));
}

TEST(LocalAlignment, PartsOfImodAreInterpolated) {
  io::ImodLocal local = some_local();
  local.parts[1].transform.shift_x_px = 4.0;           // row 0, column 0, section 1
  local.parts[2 * 3 + 1].transform.shift_y_px = -8.0;  // row 1, column 1
  local.parts[2 * 1 + 1].tilt_deg = 2.0;               // row 0, column 1
  const ViewAngles level{};
  const auto at = [&](std::int64_t section, double x, double y, double scale) {
    return place_of_imod(local, section, level, level, kViewWidth, kViewHeight, scale)(x, y);
  };
  // Pixel 20.5 of 120 that count from 1 lies 40 left of the middle, pixel 15.5 of 90 lies 30 below.
  EXPECT_NEAR(at(1, -40, -30, 1)[0], -36, 1e-12);
  EXPECT_NEAR(at(1, -60, -45, 1)[0], -56, 1e-12);  // beyond the grid, its edge counts
  EXPECT_NEAR(at(1, 40, 30, 1)[1], 22, 1e-12);
  const auto middle = at(1, 0, 0, 1);
  EXPECT_NEAR(middle[0], 1, 1e-12);
  EXPECT_NEAR(middle[1], -2, 1e-12);
  EXPECT_NEAR(at(1, 40, -30, 1)[0], 40 * std::cos(2 * M_PI / 180), 1e-12);
  EXPECT_EQ(at(0, 17, 5, 1), (geometry::ViewWarp::Vector{17, 5}));
  EXPECT_NEAR(mean_tilt_change_deg(local, 1), 0.5, 1e-12);
  // Pixels half as large: as in IMOD, the part lies at 41 and 31, and moves by twice as many.
  EXPECT_NEAR(at(1, -19.5, -14.5, 2)[0], -11.5, 1e-12);
}

TEST(LocalAlignment, PartsOfImodAreThoseOfTheUntiltedSpecimen) {
  io::ImodLocal local = some_local();
  local.parts[2 * 1 + 1].transform.shift_x_px = 4.0;  // the right lower part
  const ViewAngles tilted{.tilt_deg = 60};
  const auto place = place_of_imod(local, 1, tilted, tilted, kViewWidth, kViewHeight, 1);
  EXPECT_NEAR(place(20, -30)[0], 24, 1e-9);  // X = 20 / cos 60° is the column of that part
}

}  // namespace
}  // namespace tomofield::tilt_series
