#include "report/canvas.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
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
  draw_text(canvas, 4, 6, "L?Å", kRed);
  EXPECT_EQ(text_width("L?Å"), kDot * 17);
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

// Returns the pixels of a text at (4, 10) of a canvas that is 30 high.
std::vector<std::array<std::int64_t, 2>> pixels_of_text(std::string_view text) {
  const testing::ScratchDirectory directory;
  Canvas canvas(60, 30, {255, 255, 255});
  draw_text(canvas, 4, 10, text, kRed);
  canvas.write(directory / "text.png");
  return pixels_of(testing::read_png(directory / "text.png", PNG_FORMAT_RGB), kRed);
}

TEST(Text, HasSmallLettersThatReachBelowTheBaseLine) {
  for (const char letter : std::string_view("abcdefghijklmnopqrstuvwxyz")) {
    const std::string small(1, letter);
    const std::string capital(1, static_cast<char>(letter - 'a' + 'A'));
    const auto dots = pixels_of_text(small);
    ASSERT_FALSE(dots.empty()) << letter;
    EXPECT_NE(dots, pixels_of_text(capital)) << letter;
    std::int64_t lowest = 0;
    for (const auto& [x, y] : dots) lowest = std::max(lowest, y);
    const bool is_below = std::string_view("gjpqy").find(letter) != std::string_view::npos;
    EXPECT_EQ(lowest, is_below ? 30 - 10 + 2 * kDot - 1 : 30 - 10 - 1) << letter;
  }
  for (const char* sign : {"°", "±", "−", "×", "µ", "σ", "%", ":"})
    EXPECT_FALSE(pixels_of_text(sign).empty()) << sign;
}

}  // namespace
}  // namespace tomofield::report
