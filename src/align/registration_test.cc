#include "align/registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "gaussian_scene.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;
using Point = std::array<double, 2>;

constexpr std::int64_t kWidth = 84, kHeight = 70;
constexpr double kPixel = 2.0;                      // of the stage, in pixels of the view
constexpr double kCentreX = 41.0, kCentreY = 38.5;  // not in the middle
constexpr ViewCorrection kNone{};
constexpr Freedoms kShiftAlone{}, kAll{.rotation = true, .magnification = true, .tilt = true};
constexpr Freedoms kPlane{.rotation = true, .magnification = true};

// Returns where a point of the uncorrected view is in the corrected one.
Point undone(const ViewCorrection& c, const Point& q) {
  const double scale = std::exp(-c.log_magnification);
  const double cosine = scale * std::cos(c.rotation_rad), sine = scale * std::sin(c.rotation_rad);
  const double x = q[0] - c.shift_x_px, y = q[1] - c.shift_y_px;
  return {cosine * x + sine * y, -sine * x + cosine * y};
}

constexpr double kTilt_deg = 25;

// Makes a view that is out of alignment, and its prediction, which is not.
class MisalignedView {
 public:
  // The correction `right` makes the view show what is predicted.
  explicit MisalignedView(const ViewCorrection& right) : right_(right) {
    measured = corrected({});
    predicted = image([&](const Point& q) { return shown(q, kTilt_deg); });
    constexpr double kStep = 0.01;
    by_tilt = image([&](const Point& q) {
      return (shown(q, kTilt_deg + kStep) - shown(q, kTilt_deg - kStep)) / (2 * kStep);
    });
  }

  // Returns the view that is resampled with a correction.
  std::vector<float> corrected(const ViewCorrection& correction) const {
    const geometry::RawFromAligned map =
        geometry::corrected(geometry::RawFromAligned{}, correction.binned(kPixel));
    return image([&](const Point& q) {
      const Point recorded{map.m11 * q[0] + map.m12 * q[1] + map.shift_x_px,
                           map.m21 * q[0] + map.m22 * q[1] + map.shift_y_px};
      return shown(undone(right_.binned(kPixel), recorded), kTilt_deg + right_.tilt_deg);
    });
  }

  void add_noise(double sigma, std::uint64_t seed) {
    base::Random random(seed);
    for (float& value : measured) value += static_cast<float>(sigma * random.normal());
  }

  Registration registered() const {
    return {{.width = kWidth,
             .height = kHeight,
             .pixel = kPixel,
             .centre_x = kCentreX,
             .centre_y = kCentreY,
             .measured = measured,
             .predicted = predicted,
             .by_tilt = by_tilt},
            {}};
  }

  // Calls function(q) for each pixel and returns what it returns.
  template <typename Function>
  static std::vector<float> image(const Function& function) {
    std::vector<float> result;
    for (std::int64_t y = 0; y < kHeight; ++y)
      for (std::int64_t x = 0; x < kWidth; ++x)
        result.push_back(static_cast<float>(function(Point{
            static_cast<double>(x) + 0.5 - kCentreX, static_cast<double>(y) + 0.5 - kCentreY})));
    return result;
  }

  std::vector<float> measured, predicted, by_tilt;

 private:
  double shown(const Point& q, double tilt_deg) const {
    return scene_.projection(q[0], q[1], tilt_deg);
  }

  ViewCorrection right_;
  testing::GaussianScene scene_{25, {45, 40, 20}};
};

void expect_near(const ViewCorrection& found, const ViewCorrection& expected, double part) {
  EXPECT_NEAR(found.shift_x_px, expected.shift_x_px, part * 1.0);
  EXPECT_NEAR(found.shift_y_px, expected.shift_y_px, part * 1.0);
  EXPECT_NEAR(found.rotation_rad, expected.rotation_rad, part * 0.02);
  EXPECT_NEAR(found.log_magnification, expected.log_magnification, part * 0.02);
  EXPECT_NEAR(found.tilt_deg, expected.tilt_deg, part * 2.0);
}

constexpr ViewCorrection kShift{.shift_x_px = 0.6, .shift_y_px = -0.4};
constexpr ViewCorrection kRotation{.rotation_rad = 0.008};
constexpr ViewCorrection kMagnification{.log_magnification = -0.004};
constexpr ViewCorrection kTogether{
    .shift_x_px = -0.5, .shift_y_px = 0.7, .rotation_rad = -0.006, .log_magnification = 0.003};

TEST(Registration, FindsEachPartOfAMisalignment) {
  for (const ViewCorrection& right : {kNone, kShift, kRotation, kMagnification, kTogether}) {
    const Registration registration = MisalignedView(right).registered();
    expect_near(registration.solve(kPlane), right, 0.03);
    const ViewCorrection shift = registration.solve(kShiftAlone);
    EXPECT_EQ(shift.rotation_rad, 0.0);
    EXPECT_EQ(shift.log_magnification, 0.0);
    EXPECT_EQ(shift.tilt_deg, 0.0);
  }
}

TEST(Registration, StepsThatFollowEachOtherMakeTheViewThePrediction) {
  const ViewCorrection right{
      .shift_x_px = 3.5, .shift_y_px = -2.5, .rotation_rad = 0.04, .log_magnification = 0.015};
  MisalignedView view(right);
  ViewCorrection found;
  for (int step = 0; step < 6; ++step) {
    view.measured = view.corrected(found);
    found = found.then(view.registered().solve(kPlane));
  }
  expect_near(found, right, 1e-3);
  view.measured = view.corrected(found);
  for (std::size_t i = 0; i < view.measured.size(); ++i)
    ASSERT_NEAR(view.measured[i], view.predicted[i], 1e-3) << i;
}

TEST(Registration, FindsAChangeOfTheTilt) {
  for (const double tilt : {0.4, -0.4}) {
    ViewCorrection right = kShift;
    right.tilt_deg = tilt;
    const MisalignedView view(right);
    expect_near(view.registered().solve(kAll), right, 0.03);
    MisalignedView without = view;
    without.by_tilt.clear();
    EXPECT_EQ(without.registered().solve(kAll).tilt_deg, 0.0);
  }
}

TEST(Registration, AnotherScaleAndATrendDoNotMatter) {
  MisalignedView view(kTogether);
  const ViewCorrection plain = view.registered().solve(kPlane);
  const std::vector<float> trend = MisalignedView::image([](const Point& q) {
    return 40 + 0.2 * q[0] - 0.1 * q[1] + 0.004 * q[0] * q[0] - 0.003 * q[0] * q[1] +
           0.002 * q[1] * q[1];
  });
  for (std::size_t i = 0; i < trend.size(); ++i)
    view.measured[i] = 3.0f * view.measured[i] + trend[i];
  expect_near(view.registered().solve(kPlane), plain, 3e-3);
}

TEST(Registration, WhatIsNotMeasuredDoesNotPull) {
  MisalignedView view(kTogether);
  const std::int64_t all = view.registered().num_pixels();
  for (std::int64_t y = 0; y < 40; ++y) {
    for (std::int64_t x = 0; x + y < 50; ++x) {
      const bool is_beside = x + y >= 49 || y == 39;  // the rim of something that is masked
      view.measured[static_cast<std::size_t>(y * kWidth + x)] =
          is_beside ? 15.0f : std::numeric_limits<float>::quiet_NaN();
    }
  }
  const Registration registration = view.registered();
  EXPECT_LT(registration.num_pixels(), 0.8 * static_cast<double>(all));
  EXPECT_GT(registration.num_pixels(), 0.5 * static_cast<double>(all));
  expect_near(registration.solve(kPlane), kTogether, 0.05);
}

TEST(Registration, AnOutlierPullsLessThanInLeastSquares) {
  MisalignedView view(kShift);
  // It is where the prediction has its steepest slope, and so pulls most.
  std::size_t steepest = 0;
  double slope = 0.0;
  for (std::int64_t i = 0; i < kWidth * kHeight; ++i) {
    const std::int64_t x = i % kWidth, y = i / kWidth;
    if (x < 10 || y < 10 || x >= kWidth - 10 || y >= kHeight - 10) continue;
    const auto at = static_cast<std::size_t>(i);
    const double here = std::abs(view.predicted[at + 1] - view.predicted[at - 1]);
    if (here > slope) slope = here, steepest = at;
  }
  view.measured[steepest] += 100.0f;
  // Plain least squares is wrong by 1.8 pixels.
  expect_near(view.registered().solve(kShiftAlone), kShift, 0.6);
}

TEST(Registration, AViewWithoutMeasurementsStays) {
  MisalignedView view(kTogether);
  std::ranges::fill(view.measured, std::numeric_limits<float>::quiet_NaN());
  const Registration registration = view.registered();
  EXPECT_EQ(registration.num_pixels(), 0);
  EXPECT_EQ(registration.solve(kAll), kNone);
  EXPECT_EQ(registration.correlation(), 0.0);
  EXPECT_EQ(registration.predicted_error(kAll), 0.0);
}

TEST(Registration, FewPixelsDecideNothing) {
  for (const std::int64_t side : {14, 30}) {
    MisalignedView view(kShift);
    for (std::int64_t i = 0; i < kWidth * kHeight; ++i)
      if (i % kWidth >= side || i / kWidth >= side)
        view.measured[static_cast<std::size_t>(i)] = std::numeric_limits<float>::quiet_NaN();
    const Registration registration = view.registered();
    EXPECT_GT(registration.num_pixels(), 50);
    EXPECT_EQ(registration.solve(kShiftAlone) == kNone, side == 14) << side;
  }
}

TEST(Registration, StandardErrorIsTheScatterOverNoise) {
  constexpr int kSeeds = 50;
  for (const double sigma : {0.2, 0.8}) {
    std::array<double, 2> bias{}, scatter{}, expected{};
    for (int seed = 0; seed < kSeeds; ++seed) {
      MisalignedView view(kShift);
      view.add_noise(sigma, static_cast<std::uint64_t>(seed));
      const Registration registration = view.registered();
      const ViewCorrection found = registration.solve(kShiftAlone);
      const std::array<double, 2> error = registration.shift_error(kShiftAlone);
      const std::array<double, 2> off{found.shift_x_px - kShift.shift_x_px,
                                      found.shift_y_px - kShift.shift_y_px};
      for (std::size_t axis = 0; axis < 2; ++axis) {
        bias[axis] += off[axis] / kSeeds;
        scatter[axis] += off[axis] * off[axis] / kSeeds;
        expected[axis] += error[axis] / kSeeds;
      }
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double found = std::sqrt(scatter[axis] - bias[axis] * bias[axis]);
      EXPECT_LT(std::abs(bias[axis]), 0.6 * found);
      EXPECT_NEAR(expected[axis] / found, 1.0, 0.4) << "noise " << sigma << ", axis " << axis;
    }
  }
}

// Returns the mean over views with noise of the part by which a freedom lowers the predicted error,
// and its standard error.
std::array<double, 2> gain(const ViewCorrection& right, const Freedoms& freedoms) {
  constexpr int kSeeds = 20;
  double sum = 0.0, squares = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    MisalignedView view(right);
    view.add_noise(0.3, static_cast<std::uint64_t>(seed));
    const Registration registration = view.registered();
    const double fall =
        1.0 - registration.predicted_error(freedoms) / registration.predicted_error(kShiftAlone);
    sum += fall / kSeeds;
    squares += fall * fall / kSeeds;
  }
  return {sum, std::sqrt((squares - sum * sum) / (kSeeds - 1))};
}

TEST(Registration, PredictedErrorFallsForAFreedomThatIsThere) {
  const Freedoms rotation{.rotation = true}, magnification{.magnification = true};
  const auto of_rotation = gain({.rotation_rad = 0.02}, rotation);
  EXPECT_GT(of_rotation[0], 5 * of_rotation[1]);
  const auto of_magnification = gain({.log_magnification = 0.02}, magnification);
  EXPECT_GT(of_magnification[0], 5 * of_magnification[1]);
  for (const Freedoms& freedoms : {rotation, magnification}) {
    const auto of_none = gain(kShift, freedoms);
    EXPECT_LT(of_none[0], 2 * of_none[1]);
    EXPECT_LT(of_none[0], 0.05 * of_rotation[0]);
  }
}

TEST(Registration, CorrelationIsOneWithoutNoiseAndFallsWithIt) {
  MisalignedView view(kNone);
  for (float& value : view.measured) value = 5.0f - 0.5f * value;
  EXPECT_NEAR(view.registered().correlation(), -1.0, 1e-4);
  for (float& value : view.measured) value = 10.0f - 2.0f * value;
  EXPECT_NEAR(view.registered().correlation(), 1.0, 1e-4);
  view.add_noise(1.0, 3);
  EXPECT_LT(view.registered().correlation(), 0.95);
  EXPECT_GT(view.registered().correlation(), 0.5);
}

}  // namespace
}  // namespace tomofield::alignment
