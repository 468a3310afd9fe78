#include "align/start/transmission_pitch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

namespace tomofield::alignment {
namespace {

constexpr double kThickness_A = 1000.0, kFreePath_A = 3000.0, kIcePitch_deg = 6.0;

// Returns the pitch that views from −60 to 60° tell, whose exposures are a function of the tilt.
std::optional<FoundPitch> pitch_with(const std::function<double(double)>& exposure_at,
                                     double free_path_A = kFreePath_A) {
  std::vector<double> tilts, intensities;
  for (double tilt = -60; tilt <= 60; tilt += 3) {
    const double cosine = std::cos((tilt + kIcePitch_deg) * std::numbers::pi / 180.0);
    tilts.push_back(tilt);
    intensities.push_back(exposure_at(tilt) * std::exp(-kThickness_A / free_path_A / cosine));
  }
  return pitch_by_transmission(tilts, intensities, 1.25 * kThickness_A);
}

TEST(TransmissionPitch, IsThatOfTheLayer) {
  const auto found = pitch_with([](double) { return 200.0; });
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->deg, kIcePitch_deg, 1e-3);
  EXPECT_LT(found->error_deg, 0.5);
}

TEST(TransmissionPitch, StatesTheErrorsThatExposuresMake) {
  const auto scattered =
      pitch_with([](double tilt) { return 200.0 * (1 + 0.03 * std::sin(tilt)); });
  ASSERT_TRUE(scattered);
  EXPECT_LT(std::abs(scattered->deg - kIcePitch_deg), 2 * scattered->error_deg);
  const auto drifting = pitch_with([](double tilt) { return 200.0 * (1 + 0.01 * tilt / 120); });
  ASSERT_TRUE(drifting);
  EXPECT_LT(std::abs(drifting->deg - kIcePitch_deg), 2 * drifting->error_deg);
}

TEST(TransmissionPitch, IsNotToldByIntensitiesOfOtherOrigin) {
  const auto steady = [](double) { return 1.0; };
  EXPECT_FALSE(pitch_with(steady, 1e5)) << "views that were normalised";
  EXPECT_FALSE(pitch_with(steady, 500.0)) << "far too dense for ice";
  EXPECT_FALSE(pitch_with([](double tilt) {
    return 1 / std::cos(tilt * std::numbers::pi / 180.0);
  })) << "exposures that make up for the tilt";
  EXPECT_FALSE(pitch_with([](double tilt) { return tilt > 50 ? 0.0 : 1.0; })) << "dark views";
  EXPECT_FALSE(pitch_with([](double tilt) { return 1 + 0.9 * std::sin(tilt); })) << "disorder";
}

}  // namespace
}  // namespace tomofield::alignment
