#include "align/blur.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "random_arrays.h"

namespace tomofield::alignment {
namespace {

// Returns the sum over the whole neighbourhood of every pixel, in two dimensions and in double
// precision.
std::vector<double> direct_blur(const std::vector<float>& image, std::int64_t width,
                                double sigma_px) {
  const std::int64_t height = std::ssize(image) / width;
  const auto reach = static_cast<std::int64_t>(6 * sigma_px) + 1;
  std::vector<double> blurred;
  for (std::int64_t i = 0; i < std::ssize(image); ++i) {
    double sum = 0.0, weights = 0.0;
    for (std::int64_t dy = -reach; dy <= reach; ++dy) {
      for (std::int64_t dx = -reach; dx <= reach; ++dx) {
        const auto x = std::clamp<std::int64_t>(i % width + dx, 0, width - 1);
        const auto y = std::clamp<std::int64_t>(i / width + dy, 0, height - 1);
        const auto square = static_cast<double>(dx * dx + dy * dy);
        const double weight = std::exp(-square / (2 * sigma_px * sigma_px));
        sum += weight * static_cast<double>(image[static_cast<std::size_t>(y * width + x)]);
        weights += weight;
      }
    }
    blurred.push_back(sum / weights);
  }
  return blurred;
}

TEST(GaussianBlur, IsTheSumOfNeighboursWeightedByAGaussian) {
  for (const std::int64_t width : {23, 4, 1}) {
    const std::vector<float> image =
        testing::random_floats(static_cast<std::size_t>(17 * width), 3);
    for (const double sigma_px : {0.4, 1.0, 2.7})
      testing::expect_near(gaussian_blur(image, width, sigma_px),
                           direct_blur(image, width, sigma_px), 1.5e-3);
  }
}

TEST(GaussianBlur, AConstantStays) {
  const std::vector<float> image(13 * 9, 250.0f);
  for (const float value : gaussian_blur(image, 13, 1.5)) EXPECT_NEAR(value, 250.0f, 1e-3);
}

TEST(GaussianBlur, OfNoWidthIsTheImage) {
  const std::vector<float> image = testing::random_floats(11 * 7, 5);
  EXPECT_EQ(gaussian_blur(image, 11, 0.0), image);
}

}  // namespace
}  // namespace tomofield::alignment
