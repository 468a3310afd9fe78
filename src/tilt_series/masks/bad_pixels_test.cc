#include "tilt_series/masks/bad_pixels.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tomofield::tilt_series {
namespace {

MaskedImage noisy_image() {
  MaskedImage image(80, 60);
  base::Random random(9);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] =
        static_cast<float>(1000 + 0.5 * static_cast<double>(i % 80) + 20 * random.normal());
  }
  return image;
}

TEST(BadPixels, HotAndDeadOnesAreMaskedAndNoOthers) {
  MaskedImage image = noisy_image();
  const std::vector<std::pair<std::size_t, float>> bad{{image.index(0, 0), 65535.0f},
                                                       {image.index(40, 30), 65535.0f},
                                                       {image.index(41, 30), 9000.0f},
                                                       {image.index(79, 20), 0.0f},
                                                       {image.index(10, 50), 1500.0f}};
  for (const auto& [at, value] : bad) image.values[at] = value;
  EXPECT_EQ(mask_bad_pixels(&image), 5);
  for (const auto& [at, value] : bad) {
    EXPECT_EQ(image.valid[at], 0) << at;
    EXPECT_EQ(image.values[at], 0.0f);
  }
  EXPECT_EQ(std::count(image.valid.begin(), image.valid.end(), 0), 5);
}

TEST(BadPixels, NoiseHasNone) {
  MaskedImage image = noisy_image();
  EXPECT_EQ(mask_bad_pixels(&image), 0);
}

TEST(BadPixels, SmallDenseThingsAreNone) {
  MaskedImage image = noisy_image();
  for (const auto& [x, y] : {std::pair{20, 20}, {50, 40}}) {  // a bead of 2 × 2 pixels and its blur
    for (int dy = -1; dy <= 2; ++dy) {
      for (int dx = -1; dx <= 2; ++dx) {
        const bool is_core = dx >= 0 && dx <= 1 && dy >= 0 && dy <= 1;
        image.values[image.index(x + dx, y + dy)] = is_core ? 300.0f : 700.0f;
      }
    }
  }
  EXPECT_EQ(mask_bad_pixels(&image), 0);
}

TEST(BadPixels, CornersOfThingsWithoutNoiseAreNone) {
  MaskedImage image(64, 64);
  for (int y = 30; y < 33; ++y) {
    for (int x = 30; x < 33; ++x) image.values[image.index(x, y)] = 100.0f;
  }
  EXPECT_EQ(mask_bad_pixels(&image), 0);
}

}  // namespace
}  // namespace tomofield::tilt_series
