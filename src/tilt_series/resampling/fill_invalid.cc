#include "tilt_series/resampling/fill_invalid.h"

#include <algorithm>
#include <cstddef>

namespace tomofield::tilt_series {
namespace {

// Returns the means of the measurements in each square of 2 × 2 pixels.
MaskedImage halved(const MaskedImage& image) {
  MaskedImage half((image.width + 1) / 2, (image.height + 1) / 2);
  for (std::int64_t y = 0; y < half.height; ++y) {
    for (std::int64_t x = 0; x < half.width; ++x) {
      float sum = 0.0f;
      int count = 0;
      for (std::int64_t j = 2 * y; j < std::min(2 * y + 2, image.height); ++j) {
        for (std::int64_t i = 2 * x; i < std::min(2 * x + 2, image.width); ++i) {
          if (image.valid[image.index(i, j)] == kNoMeasurement) continue;
          sum += image.values[image.index(i, j)];
          ++count;
        }
      }
      half.valid[half.index(x, y)] = count > 0 ? kMeasurement : kNoMeasurement;
      half.values[half.index(x, y)] = count > 0 ? sum / static_cast<float>(count) : 0.0f;
    }
  }
  return half;
}

// Returns the value of an image of squares at the pixel (x, y), linear between their centres.
float between_squares(const std::vector<float>& values, const MaskedImage& half, std::int64_t x,
                      std::int64_t y) {
  const std::int64_t near_x = x / 2, near_y = y / 2;
  const std::int64_t far_x =
      std::clamp<std::int64_t>(near_x + (x % 2 == 0 ? -1 : 1), 0, half.width - 1);
  const std::int64_t far_y =
      std::clamp<std::int64_t>(near_y + (y % 2 == 0 ? -1 : 1), 0, half.height - 1);
  const auto row = [&](std::int64_t at) {
    return 0.75f * values[half.index(near_x, at)] + 0.25f * values[half.index(far_x, at)];
  };
  return 0.75f * row(near_y) + 0.25f * row(far_y);
}

}  // namespace

std::vector<float> fill_invalid(const MaskedImage& image) {
  std::vector<float> values = image.values;
  const auto is_invalid = [](std::uint8_t state) { return state == kNoMeasurement; };
  if (std::ranges::none_of(image.valid, is_invalid)) return values;
  if (std::ranges::all_of(image.valid, is_invalid)) {
    std::ranges::fill(values, 0.0f);
    return values;
  }
  const MaskedImage half = halved(image);
  const std::vector<float> coarse = fill_invalid(half);
  for (std::int64_t y = 0; y < image.height; ++y)
    for (std::int64_t x = 0; x < image.width; ++x)
      if (is_invalid(image.valid[image.index(x, y)]))
        values[image.index(x, y)] = between_squares(coarse, half, x, y);
  return values;
}

}  // namespace tomofield::tilt_series
