#include "reconstruct/axis_error.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::reconstruction {
namespace {

constexpr std::int64_t kShearWidth = 61, kShearHeight = 48;

using Point = std::array<double, 2>;

// Returns an image of spots at places that are counted from its centre.
evaluate::Image image_of(const std::vector<Point>& spots) {
  evaluate::Image image{kShearWidth, kShearHeight,
                        std::vector<float>(static_cast<std::size_t>(kShearWidth * kShearHeight))};
  for (const auto& [u, v] : spots)
    for (std::int64_t y = 0; y < kShearHeight; ++y)
      for (std::int64_t x = 0; x < kShearWidth; ++x) {
        const double dx = static_cast<double>(x) + 0.5 - kShearWidth / 2.0 - u;
        const double dy = static_cast<double>(y) + 0.5 - kShearHeight / 2.0 - v;
        image.values[static_cast<std::size_t>(y * kShearWidth + x)] +=
            static_cast<float>(std::exp(-(dx * dx + dy * dy) / 8));
      }
  return image;
}

double within(base::Random& random, double side) { return side * (random.uniform() - 0.5); }

// Moves by an affine map, beside the shear by a shift, a stretch and a rotation.
Point moved(const Point& p, double shear) {
  return {1.01 * p[0] + (shear - 0.02) * p[1] + 0.3, (shear + 0.02) * p[0] + p[1] - 0.2};
}

TEST(AxisError, FindsTheShearOfAViewAmongOtherChanges) {
  base::Random random(5);
  std::vector<Point> spots;
  for (int i = 0; i < 40; ++i) spots.push_back({within(random, 50), within(random, 40)});
  for (const double shear : {0.0, 0.01, -0.02}) {
    std::vector<Point> others;
    for (const Point& p : spots) others.push_back(moved(p, shear));
    evaluate::Image measured = image_of(others);
    for (float& value : measured.values) value = 0.9f * value + 3.0f;
    for (std::size_t i = 0; i < measured.values.size(); i += 97)
      measured.values[i] = std::numeric_limits<float>::quiet_NaN();
    const ViewShear found = shear_of(measured, image_of(spots));
    // Displacements of a pixel are not quite linear in spots that are two pixels wide.
    EXPECT_NEAR(found.shear, shear, 0.001 + 0.15 * std::abs(shear));
    EXPECT_GT(found.weight, 0);
  }
}

TEST(AxisError, AViewWithoutContrastTellsNothing) {
  const evaluate::Image blank = image_of({});
  EXPECT_EQ(shear_of(blank, blank).weight, 0);
}

// Returns the shears of views whose axis is turned by an angle, against those of a field that is
// turned as well.
std::vector<ViewShear> shears_of_views(const std::vector<double>& tilt_deg, double axis_deg) {
  const double angle = axis_deg * std::numbers::pi / 180;
  base::Random random(6);
  std::vector<ViewShear> shears;
  for (const double tilt : tilt_deg) {
    const double c = std::cos(tilt * std::numbers::pi / 180);
    const double s = std::sin(tilt * std::numbers::pi / 180);
    std::vector<Point> measured, predicted;
    for (int i = 0; i < 60; ++i) {
      const double x = within(random, 50), y = within(random, 40), z = within(random, 20);
      const double u = c * x + s * z;
      measured.push_back(
          {u * std::cos(angle) - y * std::sin(angle), u * std::sin(angle) + y * std::cos(angle)});
      predicted.push_back({c * (x * std::cos(angle) - y * std::sin(angle)) + s * z,
                           x * std::sin(angle) + y * std::cos(angle)});
    }
    shears.push_back(shear_of(image_of(measured), image_of(predicted)));
  }
  return shears;
}

TEST(AxisError, FindsHowFarTheAxisIsTurned) {
  std::vector<double> tilt_deg;
  for (int tilt = -60; tilt <= 60; tilt += 8) tilt_deg.push_back(tilt);
  for (const double axis_deg : {0.0, 2.0, -4.0}) {
    const auto found = axis_error(shears_of_views(tilt_deg, axis_deg), tilt_deg);
    ASSERT_TRUE(found.has_value());
    EXPECT_NEAR(found->angle_deg, axis_deg, 0.3 + 0.15 * std::abs(axis_deg)) << axis_deg;
    EXPECT_EQ(std::abs(found->angle_deg) > 5 * found->standard_error_deg, axis_deg != 0.0)
        << axis_deg << " " << found->angle_deg << " " << found->standard_error_deg;
  }
}

TEST(AxisError, NeedsEnoughViewsOfDifferentTilts) {
  EXPECT_FALSE(axis_error({}, {}).has_value());
  EXPECT_FALSE(axis_error(std::vector<ViewShear>(7, {0.1, 1.0}), {0, 10, 20, 30, 40, 50, 60}));
  EXPECT_FALSE(axis_error(std::vector<ViewShear>(9, {0.1, 1.0}), std::vector<double>(9, 30.0)));
}

}  // namespace
}  // namespace tomofield::reconstruction
