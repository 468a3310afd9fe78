#include "io/images/jpeg.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cmath>
#include <vector>

namespace tomofield::io {
namespace {

std::vector<std::uint8_t> decoded(const std::string& jpeg, int& width, int& height) {
  void* const decoder = tjInitDecompress();
  const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  int subsampling = 0, colours = 0;
  EXPECT_EQ(
      tjDecompressHeader3(decoder, bytes, jpeg.size(), &width, &height, &subsampling, &colours), 0);
  EXPECT_EQ(colours, TJCS_GRAY);
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * height));
  EXPECT_EQ(tjDecompress2(decoder, bytes, jpeg.size(), pixels.data(), width, 0, height, TJPF_GRAY,
                          TJFLAG_ACCURATEDCT),
            0);
  tjDestroy(decoder);
  return pixels;
}

TEST(Jpeg, HasThePixelsThatItIsGiven) {
  constexpr int kWidth = 37, kHeight = 21;
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) pixels.push_back(static_cast<std::uint8_t>(5 * x + 2 * y));
  int width = 0, height = 0;
  const std::vector<std::uint8_t> found =
      decoded(jpeg_grey(kWidth, kHeight, pixels, 90), width, height);
  ASSERT_EQ(width, kWidth);
  ASSERT_EQ(height, kHeight);
  for (std::size_t i = 0; i < pixels.size(); ++i) EXPECT_NEAR(found[i], pixels[i], 4) << i;
}

TEST(Jpeg, IsSmallerWithLessQuality) {
  std::vector<std::uint8_t> pixels;
  for (int i = 0; i < 64 * 64; ++i)
    pixels.push_back(static_cast<std::uint8_t>(127 + 120 * std::sin(i * i)));
  EXPECT_LT(2 * jpeg_grey(64, 64, pixels, 30).size(), jpeg_grey(64, 64, pixels, 90).size());
}

}  // namespace
}  // namespace tomofield::io
