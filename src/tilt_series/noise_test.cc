#include "tilt_series/noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tomofield::tilt_series {
namespace {

float smooth(std::int64_t x, std::int64_t y) {
  return 30.0f * std::sin(0.05f * static_cast<float>(x)) *
         std::cos(0.04f * static_cast<float>(y) + 1.0f);
}

MaskedImage noisy_view(double sigma, std::uint64_t seed, std::int64_t size = 256) {
  base::Random random(seed);
  MaskedImage image(size, size);
  for (std::int64_t y = 0; y < size; ++y) {
    for (std::int64_t x = 0; x < size; ++x) {
      image.values[image.index(x, y)] = smooth(x, y) + static_cast<float>(sigma * random.normal());
    }
  }
  return image;
}

TEST(Noise, WhiteNoiseOnASmoothImageIsRight) {
  for (const double sigma : {0.5, 2.0, 50.0}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      EXPECT_NEAR(estimate_noise_sigma(noisy_view(sigma, seed)), sigma, 0.05 * sigma);
    }
  }
}

TEST(Noise, RowsOfALargeViewAreEnough) {
  EXPECT_NEAR(estimate_noise_sigma(noisy_view(2.0, 6, 1800)), 2.0, 0.01);
}

TEST(Noise, BeadsAndEdgesDoNotCount) {
  MaskedImage image = noisy_view(2.0, 4);
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      const bool is_bead = (x % 40) < 6 && (y % 40) < 6;
      if (is_bead || x > 200) image.values[image.index(x, y)] -= 500.0f;
    }
  }
  EXPECT_NEAR(estimate_noise_sigma(image), 2.0, 0.2);
}

TEST(Noise, PixelsWithoutMeasurementDoNotCount) {
  MaskedImage image = noisy_view(2.0, 5);
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < 150; ++x) {
      image.values[image.index(x, y)] = 0.0f;
      image.valid[image.index(x, y)] = 0;
    }
  }
  EXPECT_NEAR(estimate_noise_sigma(image), 2.0, 0.2);
}

TEST(Noise, InterpolatedNoiseCountsAsTheWhiteNoiseThatItCameFrom) {
  // Linear interpolation half-way between pixels is the worst case: at one
  // pixel the noise looks half as large as what averages have.
  const MaskedImage raw = noisy_view(2.0, 6);
  MaskedImage image(255, 255);
  for (std::int64_t y = 0; y < 255; ++y) {
    for (std::int64_t x = 0; x < 255; ++x) {
      const auto at = [&](std::int64_t dx, std::int64_t dy) {
        return raw.values[raw.index(x + dx, y + dy)];
      };
      image.values[image.index(x, y)] = 0.25f * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1));
    }
  }
  const double sigma = estimate_noise_sigma(image);
  EXPECT_GT(sigma, 0.8);  // 0.5 at one pixel
  EXPECT_LT(sigma, 2.1);
}

TEST(Noise, OfFewGreyLevelsIsAtLeastThatOfRounding) {
  MaskedImage view = noisy_view(2.0, 4);
  for (float& value : view.values) value = std::round(value / 60.0f);
  EXPECT_GT(estimate_noise_sigma(view), 0.1);  // most differences are 0
  EXPECT_LT(estimate_noise_sigma(view), 0.5);
  base::Random random(5);  // sparse counts
  for (float& value : view.values) value = random.uniform() < 0.02 ? 1.0f : 0.0f;
  EXPECT_NEAR(estimate_noise_sigma(view), std::sqrt(0.02 * 0.98), 0.02);
}

TEST(Noise, NeverZero) {
  const MaskedImage clean = noisy_view(0.0, 1);
  EXPECT_GE(estimate_noise_sigma(clean), 1e-3 * 10.0);
  EXPECT_LT(estimate_noise_sigma(clean), 0.2);
  EXPECT_GT(estimate_noise_sigma(MaskedImage(64, 64)), 0.0);
  EXPECT_GT(estimate_noise_sigma(MaskedImage(3, 1)), 0.0);
}

}  // namespace
}  // namespace tomofield::tilt_series
