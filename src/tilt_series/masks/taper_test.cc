#include "tilt_series/masks/taper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "rotated_image.h"
#include "tilt_series/masks/fill.h"

namespace tomofield::tilt_series {
namespace {

using testing::RotatedImage;

constexpr float kFill = 99.0f;
constexpr double kRim_px = 4.0;

/// Fades the image to the fill over `length` pixels within its edge.
MaskedImage tapered_within(const RotatedImage& scene, double length) {
  MaskedImage image =
      scene.filled([](std::int64_t, std::int64_t, const MaskedImage&) { return kFill; });
  for (std::int64_t y = 0; y < scene.height; ++y) {
    for (std::int64_t x = 0; x < scene.width; ++x) {
      const auto part = static_cast<float>(std::clamp(scene.depth(x, y) / length, 0.0, 1.0));
      float& value = image.values[image.index(x, y)];
      value = kFill + part * (value - kFill);
    }
  }
  return image;
}

/// Continues the image's edge beyond it and fades that to the fill, as IMOD's newstack does for
/// TaperAtFill 1,0: means over the pixels of the edge near by.
MaskedImage tapered_beyond(const RotatedImage& scene, double length) {
  return scene.filled([&](std::int64_t x, std::int64_t y, const MaskedImage& all) {
    const double part = std::max(0.0, 1.0 + scene.depth(x, y) / length);
    if (part == 0.0) return kFill;
    double sum = 0.0, weights = 0.0;
    for (std::int64_t py = std::max<std::int64_t>(y - 24, 0); py < std::min(y + 25, scene.height);
         ++py) {
      for (std::int64_t px = std::max<std::int64_t>(x - 24, 0); px < std::min(x + 25, scene.width);
           ++px) {
        const double inside = scene.depth(px, py);
        if (inside < 0.0 || inside > 1.0) continue;
        const double distance =
            std::hypot(static_cast<double>(px - x), static_cast<double>(py - y));
        if (distance > 5.0 - scene.depth(x, y)) continue;
        sum += all.values[all.index(px, py)] / (4.0 + distance);
        weights += 1.0 / (4.0 + distance);
      }
    }
    return weights > 0.0 ? static_cast<float>(kFill + part * (sum / weights - kFill)) : kFill;
  });
}

TEST(Taper, WhatFadesWithinTheImageIsMasked) {
  for (const double length : {6.0, 12.0, 20.0}) {
    SCOPED_TRACE(length);
    // All four edges are in the picture.
    const RotatedImage scene{.left = 12.0, .right = 13.0, .bottom = 13.0, .top = 12.0};
    MaskedImage image = tapered_within(scene, length);
    mask_fill(Contrast::kDark, &image);
    // The last tenth has nearly all of the image.
    RotatedImage untouched = scene;
    for (double* offset : {&untouched.left, &untouched.right, &untouched.bottom, &untouched.top})
      *offset += 0.9 * length;
    const auto [found, lost] = untouched.score(image, kRim_px + 0.1 * length);
    EXPECT_GE(found, 0.95);
    EXPECT_LE(lost, 0.02);
  }
}

TEST(Taper, WhatContinuesTheImageIsMasked) {
  const RotatedImage scene{.left = 20.0, .right = 16.0, .bottom = 18.0, .top = 17.0};
  MaskedImage image = tapered_beyond(scene, 12.0);
  mask_fill(Contrast::kDark, &image);
  const auto [found, lost] = scene.score(image, kRim_px);
  EXPECT_GE(found, 0.95);
  EXPECT_LE(lost, 0.02);
}

TEST(Taper, OnlyTheFillIsMaskedWithoutATaper) {
  const RotatedImage scene{.left = 12.0, .right = 9.0};
  for (const double noise : {0.1, 1.0, 5.0}) {
    RotatedImage noisy = scene;
    noisy.noise = noise;
    MaskedImage image =
        noisy.filled([](std::int64_t, std::int64_t, const MaskedImage&) { return kFill; });
    mask_fill(Contrast::kDark, &image);
    EXPECT_EQ(noisy.score(image, 0.0).found, 1.0);
    EXPECT_EQ(noisy.score(image, 0.0).lost, 0.0);
  }
}

}  // namespace
}  // namespace tomofield::tilt_series
