#include "tilt_series/resampling/band_limited_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"

namespace tomofield::tilt_series {
namespace {

// A wave of (kx, ky) cycles a pixel that is its own mirror image at the first edges.
MaskedImage wave(std::int64_t width, std::int64_t height, double kx, double ky) {
  MaskedImage image(width, height);
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t x = 0; x < width; ++x)
      image.values[image.index(x, y)] = static_cast<float>(
          1000 + std::cos(2 * std::numbers::pi * kx * (static_cast<double>(x) + 0.5)) *
                     std::cos(2 * std::numbers::pi * ky * (static_cast<double>(y) + 0.5)));
  return image;
}

// Holds frequencies in cycles a pixel, and the largest error that they may have.
struct WaveCase {
  double kx, ky, error;
};

class BandLimitedImageOfAWave : public ::testing::TestWithParam<WaveCase> {};

TEST_P(BandLimitedImageOfAWave, HasItsValuesBetweenThePixels) {
  const auto [kx, ky, error] = GetParam();
  const MaskedImage image = wave(203, 150, kx, ky);
  const BandLimitedImage between(image);
  base::Random random(5, 1);
  for (int i = 0; i < 300; ++i) {
    const double x = 60 + 80 * random.uniform(), y = 50 + 50 * random.uniform();
    const double expected = 1000 + std::cos(2 * std::numbers::pi * kx * (x + 0.5)) *
                                       std::cos(2 * std::numbers::pi * ky * (y + 0.5));
    ASSERT_NEAR(static_cast<double>(between.at(x, y)), expected, error) << x << ", " << y;
  }
}

// At half of the Nyquist frequency and more, cubic convolution errs by 0.1 and more.
INSTANTIATE_TEST_SUITE_P(Waves, BandLimitedImageOfAWave,
                         ::testing::Values(WaveCase{0, 0, 2e-4}, WaveCase{0.1, 0.05, 1e-3},
                                           WaveCase{0.25, 0.25, 1e-3}, WaveCase{0.4, 0.1, 2e-3},
                                           WaveCase{0.05, 0.45, 1e-2}, WaveCase{0.45, 0.45, 2e-2}));

TEST(BandLimitedImage, HasThePixelsAtTheirPlaces) {
  MaskedImage image(37, 22);
  base::Random random(7, 1);
  for (float& value : image.values) value = static_cast<float>(random.normal());
  const BandLimitedImage between(image);
  for (std::int64_t y = 0; y < image.height; ++y)
    for (std::int64_t x = 0; x < image.width; ++x)
      ASSERT_NEAR(between.at(static_cast<double>(x), static_cast<double>(y)),
                  image.values[image.index(x, y)], 1e-3);
}

}  // namespace
}  // namespace tomofield::tilt_series
