#include "report/line_plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "png_picture.h"
#include "report/text.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

const Colour kRed{255, 0, 0};

std::vector<std::array<std::int64_t, 2>> pixels_of(const testing::PngPicture& picture,
                                                   const Colour& colour) {
  std::vector<std::array<std::int64_t, 2>> found;  // x, y from the top
  for (std::int64_t y = 0; y < picture.height; ++y)
    for (std::int64_t x = 0; x < picture.width; ++x)
      if (picture.at(x, y, 0) == colour[0] && picture.at(x, y, 1) == colour[1] &&
          picture.at(x, y, 2) == colour[2])
        found.push_back({x, y});
  return found;
}

TEST(Text, LettersAreWhereTheyBelong) {
  const testing::ScratchDirectory directory;
  Canvas canvas(60, 30, {255, 255, 255});
  draw_text(canvas, 4, 6, "l?Å", kRed);
  EXPECT_EQ(text_width("l?Å"), kDot * 17);
  canvas.write(directory / "text.png");
  const auto picture = testing::read_png(directory / "text.png", PNG_FORMAT_RGB);
  // The L: a stem of 7 dots and a foot of 5; the unknown sign is blank; Å has 16 dots.
  const auto red = pixels_of(picture, kRed);
  std::int64_t of_l = 0, of_ring = 0;
  for (const auto& [x, y] : red) {
    EXPECT_LT(y, 30 - 6);
    EXPECT_GE(y, 30 - 6 - kTextHeight);
    if (x < 4 + 5 * kDot) {
      ++of_l;
      EXPECT_TRUE(x < 4 + kDot || y >= 30 - 6 - kDot);
    } else {
      ++of_ring;
      EXPECT_GE(x, 4 + 12 * kDot);
    }
  }
  EXPECT_EQ(of_l, 11 * kDot * kDot);
  EXPECT_EQ(of_ring, 16 * kDot * kDot);
}

TEST(LinePlot, DrawsTheLineFromEndToEndWithItsGap) {
  const testing::ScratchDirectory directory;
  LinePlot plot;
  plot.x = {0.0, 0.25, 0.5, 0.75, 1.0};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  plot.lines.push_back({"", kRed, {0.0, 0.25, nan, 0.75, 5.0}});
  write_line_plot(plot, directory / "plot.png");
  const auto picture = testing::read_png(directory / "plot.png", PNG_FORMAT_RGB);
  const auto red = pixels_of(picture, kRed);
  ASSERT_FALSE(red.empty());
  std::int64_t left = picture.width, right = 0, top = picture.height, bottom = 0;
  for (const auto& [x, y] : red) {
    left = std::min(left, x), right = std::max(right, x);
    top = std::min(top, y), bottom = std::max(bottom, y);
  }
  const auto quarter = (right - left) / 4;
  for (const auto& [x, y] : red)
    EXPECT_TRUE(x <= left + quarter + 2 || x >= left + 3 * quarter - 2) << x;
  // Rising to the right, and values beyond the axis end at it.
  EXPECT_EQ(red.front()[0] > (left + right) / 2, true);
  EXPECT_EQ(red.back()[0] < (left + right) / 2, true);
  EXPECT_GT(top, 20);
  EXPECT_LT(bottom, picture.height - 40);
}

}  // namespace
}  // namespace tomofield::report
