#include "tilt_series/resampling/binning.h"

#include <gtest/gtest.h>

#include <numeric>

namespace tomofield::tilt_series {
namespace {

MaskedImage ramp(std::int64_t width, std::int64_t height) {
  MaskedImage image(width, height);
  std::iota(image.values.begin(), image.values.end(), 1.0f);
  return image;
}

TEST(Binning, WholeFactorsAreBoxMeans) {
  const MaskedImage out = reduce_image(ramp(6, 4), 2.0);
  ASSERT_EQ(out.width, 3);
  ASSERT_EQ(out.height, 2);
  EXPECT_EQ(out.values, (std::vector<float>{4.5f, 6.5f, 8.5f, 16.5f, 18.5f, 20.5f}));
}

TEST(Binning, AreasAreShared) {
  // One row of 3 by 1.5: pixels [0, 1.5) and [1.5, 3).
  MaskedImage image(3, 3);
  image.values = {1, 4, 7, 1, 4, 7, 1, 4, 7};
  const MaskedImage out = reduce_image(image, 1.5);
  ASSERT_EQ(out.width, 2);
  EXPECT_NEAR(out.values[0], (1 + 0.5 * 4) / 1.5, 1e-6);
  EXPECT_NEAR(out.values[1], (0.5 * 4 + 7) / 1.5, 1e-6);
}

TEST(Binning, CentreStaysAtTheCentre) {
  // A linear ramp about the centre stays one, with the larger pixels' step.
  for (const double factor : {1.0, 1.37, 2.0, 2.5, 3.0}) {
    for (const std::int64_t size : {16, 17}) {
      MaskedImage image(size, size);
      for (std::int64_t y = 0; y < size; ++y) {
        for (std::int64_t x = 0; x < size; ++x) {
          image.values[image.index(x, y)] =
              static_cast<float>(x) + 0.5f - 0.5f * static_cast<float>(size);
        }
      }
      const MaskedImage out = reduce_image(image, factor);
      ASSERT_EQ(out.width, static_cast<std::int64_t>(static_cast<double>(size) / factor));
      // Area means of a staircase differ from the ramp by less than its steps' eighth.
      for (std::int64_t x = 0; x < out.width; ++x) {
        const double centre = static_cast<double>(x) + 0.5 - 0.5 * static_cast<double>(out.width);
        EXPECT_NEAR(out.values[out.index(x, 0)], factor * centre, 0.126) << factor << " " << size;
      }
      EXPECT_NEAR(out.values[0], -out.values[out.index(out.width - 1, 0)], 1e-5);
    }
  }
}

TEST(Binning, KeepsThePartThatFitsInTheMiddle) {
  MaskedImage image(5, 1);
  image.values = {100, 2, 4, 6, 100};
  image.height = 1;
  MaskedImage square(5, 5);
  for (std::size_t y = 0; y < 5; ++y) {
    std::copy(image.values.begin(), image.values.end(),
              square.values.begin() + static_cast<std::ptrdiff_t>(5 * y));
  }
  const MaskedImage out = reduce_image(square, 3.0);
  ASSERT_EQ(out.values.size(), 1u);
  EXPECT_NEAR(out.values[0], 4.0, 1e-6);
}

TEST(Binning, HalfOfTheAreaMustBeValid) {
  MaskedImage image = ramp(4, 2);  // 1 2 3 4 / 5 6 7 8
  image.valid = {0, 1, 0, 0, 1, 0, 0, 1};
  const MaskedImage out = reduce_image(image, 2.0);
  EXPECT_EQ(out.valid, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(out.values, (std::vector<float>{3.5f, 0.0f}));
}

TEST(Binning, SizesSurviveRounding) {
  EXPECT_EQ(reduced_size(300, 300.0 / 100.0), 100);
  EXPECT_EQ(reduced_size(341, 16.56 * 1.1 / 16.56), 310);
  EXPECT_EQ(reduced_size(30, 0.3 / 0.1), 10);  // 0.3 / 0.1 is a little below 3
  EXPECT_EQ(reduced_size(2, 3.0), 0);
}

}  // namespace
}  // namespace tomofield::tilt_series
