#include "align/axis_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tomofield::align {
namespace {

TEST(AxisLine, FindsTheLowestPlaceOfAParabolaFarAway) {
  int count = 0;
  AxisLine line(
      [&](double axis_deg) {
        ++count;
        return std::vector{std::pow(axis_deg - 2.3, 2) + 5.0};
      },
      0.0);
  const double place = line.descend(0.0, 1.0, 3.0);
  EXPECT_EQ(place, 2.0);
  EXPECT_NEAR(line.lowest(place, 1.0), 2.3, 1e-12);
  EXPECT_EQ(count, 5);  // from -1 to 3: each place is looked at once
}

TEST(AxisLine, StaysWithinItsRange) {
  AxisLine line([](double axis_deg) { return std::vector{axis_deg}; }, 0.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), -3.0);
}

TEST(AxisLine, StaysWhereTheResidualDoesNotChange) {
  AxisLine line([](double) { return std::vector{1.0}; }, 0.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 0.0);
  EXPECT_EQ(line.lowest(0.0, 1.0), 0.0);
}

// Returns residuals of four views with a parabola, whose slopes differ by so much.
AxisLine::Residuals unequal_views(double spread) {
  return [=](double axis_deg) {
    std::vector<double> residuals;
    for (const double part : {-1.0, 1.0, -0.5, 0.5})
      residuals.push_back(std::pow(axis_deg - 1.2, 2) + part * spread * axis_deg);
    return residuals;
  };
}

TEST(AxisLine, MovesIfTheViewsAreSure) {
  AxisLine line(unequal_views(0.2), 2.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 1.0);
  EXPECT_NEAR(line.lowest(1.0, 1.0), 1.2, 1e-12);
}

TEST(AxisLine, StaysIfTheViewsDisagree) {
  AxisLine line(unequal_views(4.0), 2.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 0.0);
}

TEST(AxisLine, HasNoLowestPlaceIfTheViewsDisagreeAboutTheBend) {
  const auto bent = [](double spread) {
    return [=](double axis_deg) {
      std::vector<double> residuals;
      for (const double part : {-1.0, 1.0, -0.5, 0.5})
        residuals.push_back((1.0 + spread * part) * std::pow(axis_deg - 0.2, 2));
      return residuals;
    };
  };
  EXPECT_NEAR(AxisLine(bent(0.5), 2.0).lowest(0.0, 1.0), 0.2, 1e-12);
  EXPECT_EQ(AxisLine(bent(2.0), 2.0).lowest(0.0, 1.0), 0.0);
}

}  // namespace
}  // namespace tomofield::align
