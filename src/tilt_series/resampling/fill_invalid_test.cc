#include "tilt_series/resampling/fill_invalid.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tomofield::tilt_series {
namespace {

MaskedImage ramp(std::int64_t width, std::int64_t height) {
  MaskedImage image(width, height);
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t x = 0; x < width; ++x)
      image.values[image.index(x, y)] = static_cast<float>(x + 2 * y);
  return image;
}

void mask(MaskedImage& image, std::int64_t x0, std::int64_t y0, std::int64_t side) {
  for (std::int64_t y = y0; y < y0 + side; ++y) {
    for (std::int64_t x = x0; x < x0 + side; ++x) {
      image.valid[image.index(x, y)] = kNoMeasurement;
      image.values[image.index(x, y)] = 0.0f;
    }
  }
}

TEST(FillInvalid, KeepsMeasurementsAndGoesOnSmoothlyInHoles) {
  MaskedImage image = ramp(41, 35);
  const MaskedImage whole = image;
  mask(image, 12, 9, 6);
  mask(image, 30, 30, 1);
  const std::vector<float> filled = fill_invalid(image);
  for (std::size_t i = 0; i < filled.size(); ++i) {
    if (image.valid[i] != kNoMeasurement) {
      ASSERT_EQ(filled[i], whole.values[i]);
    }
    // Half of the hole's side is 3 pixels, over which the ramp rises by up to 9.
    ASSERT_NEAR(filled[i], whole.values[i], 6.0f);
  }
}

TEST(FillInvalid, FillsTheOutsideOfAnImageWithValuesOfItsInside) {
  MaskedImage image(20, 13);
  std::ranges::fill(image.values, 4.0f);
  for (std::int64_t y = 0; y < image.height; ++y)
    for (std::int64_t x = 0; x < image.width; ++x)
      if (x < 9 || y > 7) {
        image.valid[image.index(x, y)] = kNoMeasurement;
        image.values[image.index(x, y)] = 0.0f;
      }
  for (const float value : fill_invalid(image)) ASSERT_FLOAT_EQ(value, 4.0f);
}

TEST(FillInvalid, GivesZerosWithoutMeasurements) {
  MaskedImage image(5, 4);
  mask(image, 0, 0, 4);
  std::ranges::fill(image.valid, kNoMeasurement);
  for (const float value : fill_invalid(image)) ASSERT_EQ(value, 0.0f);
}

}  // namespace
}  // namespace tomofield::tilt_series
