#include "tilt_series/masks/spots.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/random.h"

namespace tomofield::tilt_series {
namespace {

constexpr double kStrength = 6.0;

/// Noise of deviation 1 and a shape over it.
MaskedImage noisy(const std::function<double(double x, double y)>& shape) {
  MaskedImage image(96, 80);
  base::Random random(4);
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      image.values[image.index(x, y)] = static_cast<float>(
          shape(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5) + random.normal());
    }
  }
  return image;
}

double spot(double x, double y, double at_x, double at_y, double diameter) {
  return std::hypot(x - at_x, y - at_y) < diameter / 2 ? 12.0 : 0.0;
}

TEST(Spots, AreFoundAtTheirPlacesWhateverTheirSize) {
  for (const double diameter : {3.0, 6.0, 12.0}) {
    const auto spots =
        find_spots(noisy([&](double x, double y) {
                     return spot(x, y, 30.3, 41.8, diameter) + spot(x, y, 70.5, 20.5, diameter);
                   }),
                   diameter, kStrength);
    ASSERT_EQ(spots.size(), 2u) << diameter;
    EXPECT_NEAR(spots[0].x_px, 70.5, 0.15 * diameter);
    EXPECT_NEAR(spots[0].y_px, 20.5, 0.15 * diameter);
    EXPECT_NEAR(spots[1].x_px, 30.3, 0.15 * diameter);
    EXPECT_NEAR(spots[1].y_px, 41.8, 0.15 * diameter);
    EXPECT_NEAR(spots[1].contrast, 12.0, 4.0);
  }
}

TEST(Spots, HaveTheirPlacesWithinATenthOfAPixelOnASlope) {
  for (const double at : {40.0, 40.3, 40.8}) {
    // The projection of a solid ball of 8 pixels.
    const auto ball = [at](double x, double y) {
      return 10 * std::sqrt(std::max(16 - std::pow(x - at, 2) - std::pow(y - 33.4, 2), 0.0));
    };
    const auto spots = find_spots(
        noisy([&](double x, double y) { return ball(x, y) + 0.8 * x - 0.5 * y; }), 7, kStrength);
    ASSERT_EQ(spots.size(), 1u) << at;
    EXPECT_NEAR(spots[0].x_px, at, 0.1);
    EXPECT_NEAR(spots[0].y_px, 33.4, 0.1);
  }
}

TEST(Spots, ThatTouchAreBothFound) {
  const auto spots = find_spots(
      noisy([](double x, double y) { return spot(x, y, 40, 40, 5) + spot(x, y, 47, 40, 5); }), 5,
      kStrength);
  EXPECT_EQ(spots.size(), 2u);
}

TEST(Spots, EdgesRidgesSlopesAndHolesAreNone) {
  const auto none = [](const char* what, const std::function<double(double, double)>& shape) {
    EXPECT_TRUE(find_spots(noisy(shape), 5, kStrength).empty()) << what;
  };
  none("noise", [](double, double) { return 0.0; });
  none("edge", [](double x, double y) { return x + 0.4 * y > 60 ? 30.0 : 0.0; });
  none("ridge", [](double x, double y) { return std::fabs(x - 0.7 * y - 10) < 3 ? 30.0 : 0.0; });
  none("slope", [](double x, double) { return 3.0 * x; });
  none("hole", [](double x, double y) { return -4.0 * spot(x, y, 40, 40, 5); });
}

TEST(Spots, NextToWhatWasNotMeasuredAreFound) {
  MaskedImage image = noisy([](double x, double y) { return spot(x, y, 30, 4, 5); });
  for (std::int64_t y = 40; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) image.valid[image.index(x, y)] = 0;
  }
  const auto spots = find_spots(image, 5, kStrength);
  ASSERT_EQ(spots.size(), 1u);
  EXPECT_NEAR(spots[0].y_px, 4, 1);
}

TEST(Spots, AnImageOfOneValueHasNone) {
  EXPECT_TRUE(find_spots(MaskedImage(64, 64), 4, kStrength).empty());
}

}  // namespace
}  // namespace tomofield::tilt_series
