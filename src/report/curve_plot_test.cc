#include "report/curve_plot.h"

#include <gtest/gtest.h>

#include <limits>

namespace tomofield::report {
namespace {

TEST(RoundTicks, AreOneTwoOrFiveTimesAPowerOfTenApart) {
  const auto near = [](const std::vector<double>& ticks, const std::vector<double>& expected) {
    ASSERT_EQ(ticks.size(), expected.size());
    for (std::size_t i = 0; i < ticks.size(); ++i) EXPECT_NEAR(ticks[i], expected[i], 1e-9);
  };
  near(round_ticks(0, 1), {0, 0.2, 0.4, 0.6, 0.8, 1});
  near(round_ticks(-3, 17), {0, 5, 10, 15});
  near(round_ticks(120, 480), {200, 300, 400});
}

TEST(CurvePlot, DrawsEveryCurveAndItsName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg = curve_plot_svg(
      {.x_title = "a & b", .y_title = "density"},
      {{"first", {{0, 0}, {1, 1}, {2, nan}, {3, 1}, {4, 0}}}, {"second", {{0, 1}, {4, 1}}}});
  EXPECT_NE(svg.find(">first</text>"), std::string::npos);
  EXPECT_NE(svg.find(">second</text>"), std::string::npos);
  EXPECT_NE(svg.find(">a &amp; b</text>"), std::string::npos);
  // The first curve: from the lower left corner to the top and, past the hole, back down.
  EXPECT_NE(svg.find("d=\"M70.0 305.0 L217.5 15.0 M512.5 15.0 L660.0 305.0 \""), std::string::npos)
      << svg;
}

}  // namespace
}  // namespace tomofield::report
