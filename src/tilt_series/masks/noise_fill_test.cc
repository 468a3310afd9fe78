#include "tilt_series/masks/noise_fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "rotated_image.h"
#include "tilt_series/masks/fill.h"

namespace tomofield::tilt_series {
namespace {

using testing::RotatedImage;

constexpr double kRim_px = 4.0;

/// Fills as AreTomo does: each pixel is one of the image, drawn at random near its mirror image.
MaskedImage with_pixels_near_by(const RotatedImage& scene) {
  base::Random random(scene.seed + 100);
  return scene.filled([&](std::int64_t x, std::int64_t y, const MaskedImage& all) {
    const double reach = 25.0 - 2.0 * scene.depth(x, y);
    for (;;) {
      const auto from_x = x + std::lround(random.uniform(-reach, reach));
      const auto from_y = y + std::lround(random.uniform(-reach, reach));
      if (from_x < 0 || from_x >= scene.width || from_y < 0 || from_y >= scene.height) continue;
      if (scene.depth(from_x, from_y) >= 0.0) return all.values[all.index(from_x, from_y)];
    }
  });
}

MaskedImage with_noise(const RotatedImage& scene, double deviation) {
  base::Random random(scene.seed + 200);
  return scene.filled([&](std::int64_t, std::int64_t, const MaskedImage&) {
    return static_cast<float>(100.0 + deviation * random.normal());
  });
}

void expect_masked(const RotatedImage& scene, MaskedImage image, double rim_px = kRim_px) {
  mask_fill(Contrast::kDark, &image);
  const auto [found, lost] = scene.score(image, rim_px);
  EXPECT_GE(found, 0.95);
  EXPECT_LE(lost, 0.02);
}

TEST(NoiseFill, PixelsOfTheImageAreMasked) {
  for (const double angle_deg : {-11.0, -4.0, 2.0, 5.0}) {
    for (const double noise : {0.3, 0.7}) {
      SCOPED_TRACE(angle_deg);
      SCOPED_TRACE(noise);
      const RotatedImage scene{.angle_deg = angle_deg, .noise = noise};
      expect_masked(scene, with_pixels_near_by(scene));
    }
  }
}

TEST(NoiseFill, NoiseAboutTheMeanIsMasked) {
  const RotatedImage scene{.seed = 2};
  expect_masked(scene, with_noise(scene, std::hypot(scene.structure, scene.noise)));
  expect_masked(scene, with_noise(scene, scene.noise));
}

TEST(NoiseFill, StripsOfAShiftAreMasked) {
  const RotatedImage scene{
      .angle_deg = 0.0, .left = 14.0, .right = -30.0, .bottom = -30.0, .top = -30.0};
  expect_masked(scene, with_pixels_near_by(scene));
}

TEST(NoiseFill, LargeImagesAreAveragedOverCells) {
  const RotatedImage scene{.width = 900, .height = 1100, .angle_deg = -6.0, .noise = 1.5};
  expect_masked(scene, with_pixels_near_by(scene), 2.0 * kRim_px);
}

TEST(NoiseFill, NothingIsMaskedWithoutFill) {
  for (const double noise : {0.0, 1.0, 5.0, 50.0}) {
    SCOPED_TRACE(noise);
    MaskedImage image = RotatedImage{.noise = noise}.covering_all();
    EXPECT_EQ(mask_fill(Contrast::kDark, &image), 0);
  }
}

/// Returns an image of a specimen with sharp edges in noisy empty space.
template <typename IsSpecimen>
MaskedImage in_empty_space(double density, const IsSpecimen& is_specimen) {
  const RotatedImage scene{.seed = 3};
  base::Random random(4);
  MaskedImage image = scene.covering_all();
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      float& value = image.values[image.index(x, y)];
      value = is_specimen(static_cast<double>(x), static_cast<double>(y))
                  ? value - static_cast<float>(density)
                  : static_cast<float>(100.0 + random.normal());
    }
  }
  return image;
}

TEST(NoiseFill, EmptySpaceAroundASpecimenStays) {
  for (const double density : {0.0, 1.0, 5.0}) {
    SCOPED_TRACE(density);
    MaskedImage cell = in_empty_space(density, [](double x, double y) {
      return std::hypot(x - 128.0, 1.1 * (y - 110.0)) < 100.0;
    });
    EXPECT_EQ(mask_fill(Contrast::kDark, &cell), 0);
    MaskedImage lamella = in_empty_space(density, [](double x, double y) {
      return std::abs(y - 110.0 - 0.05 * (x - 128.0)) < 40.0;
    });
    EXPECT_EQ(mask_fill(Contrast::kDark, &lamella), 0);
  }
  MaskedImage half = in_empty_space(3.0, [](double x, double y) { return x + 0.08 * y > 40.0; });
  EXPECT_EQ(mask_fill(Contrast::kDark, &half), 0);
}

}  // namespace
}  // namespace tomofield::tilt_series
