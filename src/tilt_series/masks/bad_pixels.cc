#include "tilt_series/masks/bad_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace tomofield::tilt_series {
namespace {

constexpr double kFarFromMean = 6.0;    // standard deviations
constexpr float kFarFromSpread = 3.0f;  // spreads of the pixels around
constexpr std::size_t kIgnored = 2;     // of these at either end: other bad pixels

struct Moments {
  double mean = 0.0, deviation = 0.0;
};

Moments moments_of(const MaskedImage& image) {
  double count = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!image.valid[i]) continue;
    count += 1;
    sum += static_cast<double>(image.values[i]);
  }
  if (count == 0) return {};
  const double mean = sum / count;
  double squares = 0.0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!image.valid[i]) continue;
    const double difference = static_cast<double>(image.values[i]) - mean;
    squares += difference * difference;
  }
  return {mean, std::sqrt(squares / count)};
}

/// Tells whether the pixel stands alone among the measured pixels around it.
bool is_isolated(const MaskedImage& image, std::int64_t x, std::int64_t y) {
  std::array<float, 24> around;
  std::size_t count = 0;
  for (std::int64_t py = std::max<std::int64_t>(y - 2, 0); py <= std::min(y + 2, image.height - 1);
       ++py) {
    for (std::int64_t px = std::max<std::int64_t>(x - 2, 0); px <= std::min(x + 2, image.width - 1);
         ++px) {
      const std::size_t at = image.index(px, py);
      if ((px != x || py != y) && image.valid[at]) around[count++] = image.values[at];
    }
  }
  if (count < 4 * kIgnored) return false;
  std::sort(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(count));
  const float low = around[kIgnored], high = around[count - 1 - kIgnored];
  const float reach = kFarFromSpread * (high - low), value = image.values[image.index(x, y)];
  return value > high + reach || value < low - reach;
}

/// Makes one pass. The bad pixels that it finds no longer count for the deviation of the next.
std::int64_t mask_outliers(MaskedImage* image) {
  const Moments moments = moments_of(*image);
  std::vector<std::size_t> bad;
  for (std::int64_t y = 0; y < image->height; ++y) {
    for (std::int64_t x = 0; x < image->width; ++x) {
      const std::size_t at = image->index(x, y);
      const double distance = std::fabs(static_cast<double>(image->values[at]) - moments.mean);
      if (!image->valid[at] || distance <= kFarFromMean * moments.deviation) continue;
      if (is_isolated(*image, x, y)) bad.push_back(at);
    }
  }
  for (const std::size_t at : bad) {
    image->valid[at] = 0;
    image->values[at] = 0.0f;
  }
  return static_cast<std::int64_t>(bad.size());
}

}  // namespace

std::int64_t mask_bad_pixels(MaskedImage* image) {
  constexpr int kPasses = 3;
  std::int64_t num_bad = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const std::int64_t found = mask_outliers(image);
    if (found == 0) break;
    num_bad += found;
  }
  return num_bad;
}

}  // namespace tomofield::tilt_series
