#include "verdict/axis_check.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::verdict {
namespace {

constexpr std::int64_t kSide = 64;

// Returns views of spots in a slab that is tilted about an axis in the plane of the views,
// `axis_deg` counter-clockwise from y, with noise.
std::vector<evaluate::Image> views_of_spots(const std::vector<double>& tilt_deg, double axis_deg) {
  base::Random random(8);
  std::vector<std::array<double, 3>> spots;
  for (int i = 0; i < 60; ++i)
    spots.push_back({60 * (random.uniform() - 0.5), 60 * (random.uniform() - 0.5),
                     40 * (random.uniform() - 0.5)});
  const double axis = axis_deg * std::numbers::pi / 180;
  std::vector<evaluate::Image> views;
  for (const double tilt : tilt_deg) {
    evaluate::Image view{kSide, kSide, std::vector<float>(kSide * kSide)};
    const double angle = tilt * std::numbers::pi / 180;
    for (const auto& [across, along, z] : spots) {
      const double u = across * std::cos(angle) + z * std::sin(angle);
      const double x = u * std::cos(axis) - along * std::sin(axis) + kSide / 2.0;
      const double y = u * std::sin(axis) + along * std::cos(axis) + kSide / 2.0;
      for (std::int64_t j = 0; j < kSide; ++j)
        for (std::int64_t i = 0; i < kSide; ++i)
          view.values[static_cast<std::size_t>(j * kSide + i)] +=
              static_cast<float>(std::exp(-0.5 *
                                          (std::pow(static_cast<double>(i) + 0.5 - x, 2) +
                                           std::pow(static_cast<double>(j) + 0.5 - y, 2)) /
                                          4));
    }
    for (float& value : view.values) value += 0.2f * static_cast<float>(random.normal());
    views.push_back(std::move(view));
  }
  return views;
}

std::vector<double> tilts() {
  std::vector<double> all;
  for (int tilt = -60; tilt <= 60; tilt += 8) all.push_back(tilt);
  return all;
}

TEST(AxisCheck, FindsTheDirectionOfTheAxis) {
  for (const double axis_deg : {0.0, 30.0, -64.0, 84.0}) {
    const auto check = check_axis(views_of_spots(tilts(), axis_deg), tilts());
    ASSERT_TRUE(check.has_value());
    EXPECT_NEAR(check->direction_deg, axis_deg, 4) << axis_deg;
    EXPECT_GT(check->best, check->usual + 0.2) << axis_deg;
    EXPECT_EQ(check->vertical > 0.95 * check->best, axis_deg == 0.0) << axis_deg;
  }
}

TEST(AxisCheck, NeedsViewsThatAreFarEnoughApart) {
  const std::vector<double> near{0, 1, 2, 3, 4, 5};
  EXPECT_FALSE(check_axis(views_of_spots(near, 0), near).has_value());
  EXPECT_FALSE(check_axis({}, {}).has_value());
}

}  // namespace
}  // namespace tomofield::verdict
