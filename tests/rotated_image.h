#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "tilt_series/image.h"

namespace tomofield::testing {

/// An image of smooth random structure and white noise that was rotated and shifted, so that some
/// pixels lie outside of it.
struct RotatedImage {
  std::int64_t width = 256, height = 220;
  double angle_deg = 5.0;
  double left = 3.0, right = 6.0, bottom = 5.0, top = 0.0;  ///< offsets from the edges, px
  double structure = 1.0;                                   ///< standard deviation
  double noise = 1.0;
  std::uint64_t seed = 1;

  /// Returns how far a pixel lies within the image, in px; negative: outside.
  double depth(std::int64_t x, std::int64_t y) const {
    const double angle = angle_deg * std::numbers::pi / 180.0;
    const double half_width = 0.5 * static_cast<double>(width);
    const double half_height = 0.5 * static_cast<double>(height);
    const double dx = static_cast<double>(x) + 0.5 - half_width;
    const double dy = static_cast<double>(y) + 0.5 - half_height;
    const double u = dx * std::cos(angle) + dy * std::sin(angle);
    const double v = -dx * std::sin(angle) + dy * std::cos(angle);
    return std::min({u + half_width - left, half_width - right - u, v + half_height - bottom,
                     half_height - top - v});
  }

  /// Returns the image as if it covered everything.
  tilt_series::MaskedImage covering_all() const {
    base::Random random(seed);
    tilt_series::MaskedImage image(width, height);
    constexpr int kWaves = 80;
    for (int wave = 0; wave < kWaves; ++wave) {
      const double length = random.uniform(6.0, 60.0), phase = random.uniform(0.0, 6.28);
      const double direction = random.uniform(0.0, 6.28);
      const double kx = 2.0 * std::numbers::pi / length * std::cos(direction);
      const double ky = 2.0 * std::numbers::pi / length * std::sin(direction);
      const double size = structure * std::sqrt(2.0 / kWaves);
      for (std::int64_t y = 0; y < height; ++y)
        for (std::int64_t x = 0; x < width; ++x)
          image.values[image.index(x, y)] += static_cast<float>(
              size * std::sin(kx * static_cast<double>(x) + ky * static_cast<double>(y) + phase));
    }
    for (float& value : image.values) value += static_cast<float>(100.0 + noise * random.normal());
    return image;
  }

  /// Replaces every pixel outside by fill(x, y, image as if it covered everything).
  template <typename Fill>
  tilt_series::MaskedImage filled(const Fill& fill) const {
    const tilt_series::MaskedImage all = covering_all();
    tilt_series::MaskedImage image = all;
    for (std::int64_t y = 0; y < height; ++y)
      for (std::int64_t x = 0; x < width; ++x)
        if (depth(x, y) < 0.0) image.values[image.index(x, y)] = fill(x, y, all);
    return image;
  }

  /// Says how right a mask is: the part of the fill that is masked, and the part of the image that
  /// is masked though it lies more than `rim_px` from the fill.
  struct Score {
    double found = 0.0, lost = 0.0;
  };
  Score score(const tilt_series::MaskedImage& masked, double rim_px) const {
    double fill = 0.0, found = 0.0, image = 0.0, lost = 0.0;
    for (std::int64_t y = 0; y < height; ++y) {
      for (std::int64_t x = 0; x < width; ++x) {
        const double inside = depth(x, y);
        const bool is_masked = masked.valid[masked.index(x, y)] == 0;
        fill += inside < 0.0;
        found += inside < 0.0 && is_masked;
        image += inside > rim_px;
        lost += inside > rim_px && is_masked;
      }
    }
    return {found / std::max(fill, 1.0), lost / image};
  }
};

}  // namespace tomofield::testing
