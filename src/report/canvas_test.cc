#include "report/canvas.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

#include "png_picture.h"
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
  // The L has a stem of 7 dots and a foot of 5. The unknown sign is blank. Å has 16 dots.
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

}  // namespace
}  // namespace tomofield::report
