#include "align/start/axis_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tomofield::alignment {
namespace {

// Returns the residuals of two views that are alike but for a constant.
std::vector<double> two_views(double residual) { return {residual, residual + 1.0}; }

TEST(AxisLine, FindsTheLowestPlaceOfAParabolaFarAway) {
  int count = 0;
  AxisLine line(
      [&](double axis_deg) {
        ++count;
        return two_views(std::pow(axis_deg - 2.3, 2));
      },
      2.0);
  const double place = line.descend(0.0, 1.0, 3.0);
  EXPECT_EQ(place, 2.0);
  EXPECT_NEAR(line.lowest(place, 1.0, 1.0), 2.3, 1e-12);
  EXPECT_EQ(count, 5);  // from -1 to 3: each place is looked at once
}

TEST(AxisLine, StaysWithinItsRange) {
  AxisLine line([](double axis_deg) { return two_views(axis_deg); }, 2.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), -3.0);
}

TEST(AxisLine, StaysWhereTheResidualDoesNotChange) {
  AxisLine line([](double) { return two_views(1.0); }, 2.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 0.0);
  EXPECT_EQ(line.lowest(0.0, 1.0, 4.0), 0.0);
}

TEST(AxisLine, StaysInAHollow) {
  AxisLine line(
      [](double axis_deg) {
        return two_views(std::abs(axis_deg) < 0.5 ? 0.0 : 2.0 - 0.1 * axis_deg);
      },
      2.0);
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 0.0) << "both sides are higher, whatever the slope";
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
  EXPECT_TRUE(line.leans(0.0, 1.0));
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 1.0);
  EXPECT_NEAR(line.lowest(1.0, 1.0, 1.0), 1.2, 1e-12);
}

TEST(AxisLine, StaysIfTheViewsDisagree) {
  AxisLine line(unequal_views(4.0), 2.0);
  EXPECT_FALSE(line.leans(0.0, 1.0));
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
  EXPECT_NEAR(AxisLine(bent(0.5), 2.0).lowest(0.0, 1.0, 1.0), 0.2, 1e-12);
  EXPECT_EQ(AxisLine(bent(2.0), 2.0).lowest(0.0, 1.0, 1.0), 0.0);
}

TEST(AxisLine, TakesAWiderParabolaIfTheViewsDisagreeAboutTheBendOfANarrowOne) {
  AxisLine line(
      [](double axis_deg) {
        const double noise = axis_deg == 0.0 ? 0.5 : 0.0;  // of a fit
        return std::vector{std::pow(axis_deg - 0.2, 2) + noise,
                           std::pow(axis_deg - 0.2, 2) - noise};
      },
      2.0);
  EXPECT_EQ(line.lowest(0.0, 0.25, 0.5), 0.0);
  EXPECT_NEAR(line.lowest(0.0, 0.25, 2.0), 0.2, 1e-12);
}

}  // namespace
}  // namespace tomofield::alignment
