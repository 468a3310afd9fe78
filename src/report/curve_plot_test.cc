#include "report/curve_plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <string>
#include <utility>

#include "png_picture.h"
#include "scratch_directory.h"

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
  EXPECT_FALSE(std::signbit(round_ticks(0, 1).front()));
}

TEST(LogTicks, AreOneTwoAndFiveTimesPowersOfTen) {
  const auto labels = [](double low, double high) {
    std::string all;
    for (const Tick& tick : log_ticks(low, high)) {
      EXPECT_NEAR(std::pow(10, tick.at), std::stod(tick.label), 1e-9 * high);
      all += tick.label + " ";
    }
    return all;
  };
  EXPECT_EQ(labels(0.9, 30), "1 2 5 10 20 ");
  EXPECT_EQ(labels(0.04, 0.6), "0.05 0.1 0.2 0.5 ");
  EXPECT_EQ(labels(0.5, 2e4), "1 10 100 1000 10000 ");
}

TEST(CurvePlot, DrawsEveryCurveAndItsName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg = curve_plot_svg({.x_title = "a & b", .y_title = "density"},
                                         {{"first", {{0, 0}, {1, 1}, {2, nan}, {3, 1}, {4, 0}}},
                                          {"second", {{0, 1}, {4, 1}}}})
                              .text();
  EXPECT_NE(svg.find(">first</text>"), std::string::npos);
  EXPECT_NE(svg.find(">second</text>"), std::string::npos);
  EXPECT_NE(svg.find(">a &amp; b</text>"), std::string::npos);
  // The first curve runs from the lower left corner to the top and, past the hole, back down.
  EXPECT_NE(svg.find("d=\"M70.0 305.0 L217.5 30.0 \""), std::string::npos) << svg;
  EXPECT_NE(svg.find("d=\"M512.5 30.0 L660.0 305.0 \""), std::string::npos) << svg;
}

TEST(CurvePlot, TwelveCurvesHaveColoursOfTheirOwn) {
  const std::string svg = curve_plot_svg({.x_title = "x", .y_title = "y"},
                                         std::vector<Curve>(12, Curve{"curve", {{0, 0}, {1, 1}}}))
                              .text();
  std::set<std::string> colours;
  const std::string key = "stroke=\"";
  for (std::size_t at = svg.find(key); at != std::string::npos; at = svg.find(key, at + 1))
    colours.insert(svg.substr(at + key.size(), 7));
  EXPECT_EQ(colours.size(), 12u + 1u);  // and the grid's
}

// Returns the heights of the texts in the legend and the height of the picture.
std::pair<std::vector<double>, double> legend_of(const std::vector<Curve>& curves) {
  const std::string svg = curve_plot_svg({.x_title = "x", .y_title = "y"}, curves).text();
  std::vector<double> heights;
  const std::string key = "<text x=\"708.0\" y=\"";
  for (std::size_t at = svg.find(key); at != std::string::npos; at = svg.find(key, at + 1))
    heights.push_back(std::stod(svg.substr(at + key.size())));
  return {heights, std::stod(svg.substr(svg.find(" height=\"") + 9))};
}

TEST(CurvePlot, HasALegendThatIsAllThereHoweverLong) {
  for (const std::size_t count : {2u, 15u, 16u, 17u, 40u}) {
    const auto [heights, height] =
        legend_of(std::vector<Curve>(count, Curve{"curve", {{0, 0}, {1, 1}}}));
    ASSERT_EQ(heights.size(), count);
    EXPECT_LT(heights.back() + 4, height) << count << ", descenders too";
    EXPECT_EQ(height > 360, count > 16) << count;
    for (std::size_t i = 1; i < count; ++i) EXPECT_GE(heights[i], heights[i - 1] + 16);
  }
  const auto [heights, height] =
      legend_of({{"a name of so many words that they do not fit into the width of the legend", {}},
                 {"second", {}}});
  EXPECT_EQ(heights.size(), 3u + 1u);
}

TEST(CurvePlot, HasTheTicksThatAreGiven) {
  const std::string svg = curve_plot_svg({.x_title = "x",
                                          .y_title = "y",
                                          .x_range = {0, 2},
                                          .y_range = {0, 1},
                                          .y_ticks = {{0.5, "half"}}},
                                         {})
                              .text();
  EXPECT_NE(svg.find("d=\"M70.0 167.5 L660.0 167.5 \""), std::string::npos) << svg;
  EXPECT_NE(svg.find(">half</text>"), std::string::npos);
  EXPECT_EQ(svg.find(">0.8</text>"), std::string::npos);
  EXPECT_NE(svg.find(">1.5</text>"), std::string::npos);
}

TEST(CurvePlot, IsTheSameOnPixels) {
  const testing::ScratchDirectory directory;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  write_curve_plot({.x_title = "x", .y_title = "y", .y_range = {0, 1}},
                   {{"", {{0.0, 0.0}, {0.25, 0.25}, {0.5, nan}, {0.75, 0.75}, {1.0, 5.0}}}},
                   directory / "plot.png");
  const auto picture = testing::read_png(directory / "plot.png", PNG_FORMAT_RGB);
  ASSERT_EQ(picture.width, 900);
  ASSERT_EQ(picture.height, 360);
  int drawn = 0;
  for (std::int64_t y = 0; y < picture.height; ++y) {
    for (std::int64_t x = 0; x <= 662; ++x) {
      if (picture.at(x, y, 0) != 0x00 || picture.at(x, y, 1) != 0x72) continue;
      ++drawn;
      EXPECT_TRUE(x <= 217 + 2 || x >= 512 - 2) << x << ", the gap";
      EXPECT_GE(y, 30 - 2) << "beyond the axis";
      // The curve rises to the right along the diagonal, and again from 0.75 to the end of the
      // axis.
      const double height = (305.0 - static_cast<double>(y)) / 275;
      const double along = (static_cast<double>(x) - 70) / 590;
      EXPECT_NEAR(height, along, 0.02) << x << " " << y;
    }
  }
  EXPECT_GT(drawn, 500);
}

}  // namespace
}  // namespace tomofield::report
