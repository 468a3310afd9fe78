#include "report/page_picture.h"

#include <gtest/gtest.h>

#include <vector>

#include "base/random.h"
#include "io/images/png.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::report {
namespace {

TEST(PagePicture, OfASmallFileIsTheFile) {
  const testing::ScratchDirectory directory;
  directory.write("small.png", "foobar");
  EXPECT_EQ(page_picture(directory / "small.png"), "data:image/png;base64,Zm9vYmFy");
  EXPECT_THROW(page_picture(directory / "none.png"), Error);
}

TEST(PagePicture, OfALargeFileIsReduced) {
  const testing::ScratchDirectory directory;
  constexpr std::int64_t kWidth = 1501, kHeight = 801;
  base::Random random(1);
  std::vector<std::uint8_t> pixels;
  for (std::int64_t i = 0; i < kWidth * kHeight; ++i)
    pixels.push_back(static_cast<std::uint8_t>(random.below(256)));
  io::write_png_grey(directory / "large.png", kWidth, kHeight, pixels);
  const std::string address = page_picture(directory / "large.png");
  EXPECT_TRUE(address.starts_with("data:image/jpeg;base64,")) << address.substr(0, 40);
  EXPECT_LT(address.size(), 600'000u);
  EXPECT_THROW(page_picture(directory.write("damaged.png", std::string(2 << 20, 'x'))), Error);
}

TEST(ReadPng, GivesWhatWasWritten) {
  const testing::ScratchDirectory directory;
  const std::vector<std::uint8_t> pixels{1, 2, 3, 40, 50, 60, 7, 8, 9, 255, 0, 128};
  io::write_png_rgb(directory / "p.png", 2, 2, pixels);
  const io::RgbImage image = io::read_png(directory / "p.png");
  EXPECT_EQ(image.width, 2);
  EXPECT_EQ(image.pixels, pixels);
}

}  // namespace
}  // namespace tomofield::report
