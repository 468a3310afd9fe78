#include "tilt_series/flat_fill.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/random.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kSize = 40;

/// Noise, and one value in two corners as a rotated image has it.
MaskedImage with_fill(float fill) {
  base::Random random(1);
  MaskedImage image(kSize, kSize);
  for (std::int64_t y = 0; y < kSize; ++y) {
    for (std::int64_t x = 0; x < kSize; ++x) {
      const bool is_outside = x + 3 * y < 40 || (kSize - x) + 3 * (kSize - y) < 40;
      image.values[image.index(x, y)] =
          is_outside ? fill : static_cast<float>(100.0 + random.normal());
    }
  }
  return image;
}

TEST(FlatFill, ExactlyTheFillIsMasked) {
  const MaskedImage before = with_fill(100.25f);
  MaskedImage image = before;
  const auto fill = std::count(before.values.begin(), before.values.end(), 100.25f);
  EXPECT_EQ(mask_flat_fill(Contrast::kDark, &image), fill);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    EXPECT_EQ(image.valid[i] == 0, before.values[i] == 100.25f);
  }
}

TEST(FlatFill, SmallAndInnerRegionsStay) {
  MaskedImage image = with_fill(100.25f);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const auto x = static_cast<std::int64_t>(i) % kSize, y = static_cast<std::int64_t>(i) / kSize;
    if (image.values[i] == 100.25f) image.values[i] = static_cast<float>(i);
    if (x >= 15 && x < 25 && y >= 15 && y < 25) image.values[i] = 7.0f;  // 100 pixels inside
    if (x < 7 && y >= 20 && y < 29) image.values[i] = 8.0f;              // 63 at the edge
  }
  EXPECT_EQ(mask_flat_fill(Contrast::kDark, &image), 0);
}

TEST(FlatFill, EmptySpaceOfBrightDataIsAMeasurement) {
  MaskedImage empty_space = with_fill(0.0f);
  EXPECT_EQ(mask_flat_fill(Contrast::kBright, &empty_space), 0);
  MaskedImage mean_fill = with_fill(100.25f);
  EXPECT_GT(mask_flat_fill(Contrast::kBright, &mean_fill), 100);
}

}  // namespace
}  // namespace tomofield::tilt_series
