#include "measurement/noise_colour.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace tomofield::measurement {
namespace {

constexpr std::int64_t kWidth = 150, kHeight = 120;

std::vector<float> white_noise(std::uint64_t stream) {
  base::Random random(9, stream);
  std::vector<float> image(kWidth * kHeight);
  for (float& value : image) value = static_cast<float>(random.normal());
  return image;
}

// Averages each pixel with its neighbours along x and y, by the weights 1, 2, 1. The power at a
// frequency (kx, ky) is cos⁴(π kx) cos⁴(π ky).
std::vector<float> blurred(const std::vector<float>& image) {
  std::vector<float> result(image.size());
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return image[static_cast<std::size_t>((y + kHeight) % kHeight * kWidth +
                                          (x + kWidth) % kWidth)];
  };
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) {
      float sum = 0;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          sum += static_cast<float>((2 - std::abs(dx)) * (2 - std::abs(dy))) * at(x + dx, y + dy);
      result[static_cast<std::size_t>(y * kWidth + x)] = sum / 16;
    }
  return result;
}

double dot(std::span<const float> a, std::span<const float> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum;
}

TEST(NoiseColour, OfWhiteNoiseIsOne) {
  std::vector<float> residual = white_noise(1);
  const std::vector<double> weights = NoiseColour(kWidth, kHeight).weigh(residual);
  // The first and the last shells have few frequencies.
  for (std::size_t s = 4; s + 4 < weights.size(); ++s) EXPECT_NEAR(weights[s], 1.0, 0.25) << s;
}

TEST(NoiseColour, FollowsTheInversePowerOfTheNoise) {
  std::vector<float> residual = blurred(white_noise(2));
  const std::vector<double> weights = NoiseColour(kWidth, kHeight).weigh(residual);
  const auto weight_at = [&](double k) {
    std::size_t shell = 0;
    while (NoiseColour::frequency_of(static_cast<std::int64_t>(shell)) < k) ++shell;
    return weights[shell];
  };
  // Along x the power is cos⁴(π k): 0.43 at a fifth of a cycle, and 0.12 at 0.3.
  EXPECT_NEAR(weight_at(0.3) / weight_at(0.2), 0.43 / 0.12, 0.8);
  EXPECT_LT(weight_at(0.05), weight_at(0.2));
  EXPECT_LE(*std::ranges::max_element(weights) / *std::ranges::min_element(weights),
            NoiseColour::kMost / NoiseColour::kLeast + 1e-9);
}

TEST(NoiseColour, KeepsTheSumOfSquares) {
  const std::vector<float> residual = blurred(white_noise(3));
  std::vector<float> weighted = residual;
  NoiseColour(kWidth, kHeight).weigh(weighted);
  EXPECT_NEAR(dot(residual, weighted) / dot(residual, residual), 1.0, 0.01);
  EXPECT_GT(dot(weighted, weighted) / dot(residual, residual), 1.05);
}

TEST(NoiseColour, OfNoResidualIsOne) {
  std::vector<float> residual(kWidth * kHeight);
  EXPECT_EQ(NoiseColour(kWidth, kHeight).weigh(residual),
            std::vector<double>(NoiseColour::kShells, 1.0));
  EXPECT_EQ(dot(residual, residual), 0.0);
}

}  // namespace
}  // namespace tomofield::measurement
