#include "tilt_series/resampling/align_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"

namespace tomofield::tilt_series {
namespace {

MaskedImage noise(std::int64_t width, std::int64_t height) {
  MaskedImage image(width, height);
  base::Random random(11, 1);
  for (float& value : image.values) value = static_cast<float>(100 + random.normal());
  return image;
}

RawFromAligned turned(double angle_deg, double scale, double shift_x, double shift_y) {
  const double angle = angle_deg * std::numbers::pi / 180;
  const double c = scale * std::cos(angle), s = scale * std::sin(angle);
  return {c, -s, s, c, shift_x, shift_y};
}

// Holds sums of the pixels that count, and of products with their right neighbours.
struct NoiseStatistics {
  double variance = 0, neighbours = 0;  // the latter over the variance
  explicit NoiseStatistics(const MaskedImage& image) {
    double n = 0, products = 0;
    for (std::int64_t y = 0; y < image.height; ++y) {
      for (std::int64_t x = 0; x + 1 < image.width; ++x) {
        const std::size_t at = image.index(x, y);
        if (!image.valid[at] || !image.valid[at + 1]) continue;
        const double here = image.values[at] - 100.0f, there = image.values[at + 1] - 100.0f;
        n += 1;
        variance += here * here;
        products += here * there;
      }
    }
    neighbours = products / variance;
    variance /= n;
  }
};

class AlignImageOfNoise : public ::testing::TestWithParam<RawFromAligned> {};

TEST_P(AlignImageOfNoise, LeavesWhiteNoiseWhite) {
  const MaskedImage raw = noise(256, 240);
  const NoiseStatistics before(raw);
  const NoiseStatistics after(align_image(raw, GetParam(), 256, 240));
  EXPECT_NEAR(after.variance / before.variance, 1.0, 0.02);
  EXPECT_NEAR(after.neighbours, before.neighbours, 0.015);
}

INSTANTIATE_TEST_SUITE_P(Maps, AlignImageOfNoise,
                         ::testing::Values(RawFromAligned{1, 0, 0, 1, 0.5, 0.5},
                                           turned(1.0, 1.0, 0, 0), turned(-7.0, 1.0, 3.3, -1.2),
                                           turned(0.0, 1.005, 0, 0)));

TEST(AlignImage, CopiesPixelsThatAreShiftedByWholePixels) {
  const MaskedImage raw = noise(40, 33);
  const MaskedImage aligned = align_image(raw, {1, 0, 0, 1, 3, -2}, 38, 35);
  for (std::int64_t y = 0; y < aligned.height; ++y) {
    for (std::int64_t x = 0; x < aligned.width; ++x) {
      const std::int64_t raw_x = x + 4, raw_y = y - 3;
      const bool is_inside = raw_x < raw.width && raw_y >= 0 && raw_y < raw.height;
      const std::size_t at = aligned.index(x, y);
      ASSERT_EQ(aligned.valid[at] != 0, is_inside);
      ASSERT_EQ(aligned.values[at], is_inside ? raw.values[raw.index(raw_x, raw_y)] : 0.0f);
    }
  }
}

TEST(AlignImage, LosesOnlyPixelsWhoseFourNeighboursAreNotAllMeasured) {
  MaskedImage raw = noise(50, 44);
  raw.valid[raw.index(20, 15)] = kNoMeasurement;
  raw.values[raw.index(20, 15)] = 0.0f;
  const MaskedImage aligned = align_image(raw, {1, 0, 0, 1, 0.5, 0.25}, 50, 44);
  for (std::int64_t y = 0; y < 43; ++y)
    for (std::int64_t x = 0; x < 49; ++x)
      ASSERT_EQ(aligned.valid[aligned.index(x, y)] == 0,
                (x == 19 || x == 20) && (y == 14 || y == 15));
  EXPECT_EQ(aligned.valid[aligned.index(49, 10)], 0);  // beyond the last column
}

TEST(AlignImage, AMaskedSpotDoesNotRing) {
  MaskedImage raw = noise(60, 60);
  std::ranges::fill(raw.values, 100.0f);
  for (std::int64_t y = 25; y < 33; ++y) {
    for (std::int64_t x = 25; x < 33; ++x) {
      raw.valid[raw.index(x, y)] = kNoMeasurement;
      raw.values[raw.index(x, y)] = 0.0f;
    }
  }
  const MaskedImage aligned = align_image(raw, turned(3.0, 1.0, 0.4, 0.1), 60, 60);
  for (std::size_t i = 0; i < aligned.values.size(); ++i)
    if (aligned.valid[i]) {
      ASSERT_NEAR(aligned.values[i], 100.0f, 1e-3f);
    }
}

TEST(AlignImageThreads, GiveTheSameBits) {
  const MaskedImage raw = noise(70, 51);
  const auto aligned_by = [&](int threads) {
    base::set_thread_count(threads);
    std::vector<float> values = align_image(raw, turned(2.0, 0.99, 1.3, 0), 70, 51).values;
    base::set_thread_count(1);
    return values;
  };
  EXPECT_EQ(aligned_by(1), aligned_by(3));
}

}  // namespace
}  // namespace tomofield::tilt_series
