#include "tilt_series/masks/taper.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kLongestTaper_px = 256;  // as long as IMOD makes them
constexpr std::int64_t kShortestTaper_px = 3;
constexpr std::int64_t kFewestPixels = 64;  // at one distance
constexpr double kMaxAtFill = 0.4;          // detail, relative to that beyond the taper
constexpr double kNearlyAll = 0.9;

/// Returns the distance of each pixel from the nearest one of the fill, in pixels, by steps to
/// the eight neighbours (longer than the distance as the crow flies by up to 8 %).
std::vector<float> distances(const std::vector<std::uint8_t>& is_fill, std::int64_t width,
                             std::int64_t height) {
  constexpr float kDiagonal = 1.41421356f;
  std::vector<float> distance(is_fill.size());
  for (std::size_t i = 0; i < is_fill.size(); ++i)
    distance[i] = is_fill[i] ? 0.0f : std::numeric_limits<float>::max();
  const auto relax = [&](std::int64_t x, std::int64_t y, std::int64_t dx, std::int64_t dy) {
    if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height) return;
    const float step = dx != 0 && dy != 0 ? kDiagonal : 1.0f;
    float& here = distance[static_cast<std::size_t>(y * width + x)];
    here = std::min(here, distance[static_cast<std::size_t>((y + dy) * width + x + dx)] + step);
  };
  const auto sweep = [&](std::int64_t x, std::int64_t y, std::int64_t sign) {
    relax(x, y, -sign, 0);
    for (const std::int64_t dx : {-1, 0, 1}) relax(x, y, dx, -sign);
  };
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t x = 0; x < width; ++x) sweep(x, y, 1);
  for (std::int64_t y = height - 1; y >= 0; --y)
    for (std::int64_t x = width - 1; x >= 0; --x) sweep(x, y, -1);
  return distance;
}

/// Means over the pixels at one distance from the fill.
struct Shell {
  double detail = 0.0;      // size of mixed second differences
  double difference = 0.0;  // size of the difference from the fill
  double count = 0.0;

  void operator+=(const Shell& other) {
    detail += other.detail;
    difference += other.difference;
    count += other.count;
  }
  void divide() {
    detail /= std::max(count, 1.0);
    difference /= std::max(count, 1.0);
  }
};

/// Returns sums over the pixels at each whole distance.
std::vector<Shell> sum_shells(const MaskedImage& image, const std::vector<float>& distance,
                              double fill_value) {
  std::vector<Shell> shells(static_cast<std::size_t>(3 * kLongestTaper_px));
  for (std::int64_t y = 0; y + 1 < image.height; ++y) {
    for (std::int64_t x = 0; x + 1 < image.width; ++x) {
      const std::size_t at = image.index(x, y), above = image.index(x, y + 1);
      const auto shell = static_cast<std::size_t>(
          std::min(distance[at], static_cast<float>(3 * kLongestTaper_px)));
      const bool is_measured =
          image.valid[at] && image.valid[at + 1] && image.valid[above] && image.valid[above + 1];
      if (!is_measured || shell >= shells.size()) continue;
      const auto& v = image.values;
      const double mixed = static_cast<double>(v[at]) - v[at + 1] - v[above] + v[above + 1];
      shells[shell] += {std::fabs(mixed), std::fabs(v[at] - fill_value), 1.0};
    }
  }
  return shells;
}

/// Returns how far the taper reaches from the fill, if there is one.
std::optional<std::int64_t> find_taper(const std::vector<Shell>& sums) {
  const auto mean_of = [&](std::int64_t begin, std::int64_t end) {
    Shell mean;
    for (std::int64_t i = begin; i < std::min(end, std::ssize(sums)); ++i)
      mean += sums[static_cast<std::size_t>(i)];
    mean.divide();
    return mean;
  };
  std::int64_t first = 0;  // pixels at the fill are measured with those beside them
  while (first < std::ssize(sums) && sums[static_cast<std::size_t>(first)].count < kFewestPixels)
    ++first;
  const Shell at_fill = mean_of(first, first + 2);
  for (std::int64_t reach = first; reach <= kLongestTaper_px; ++reach) {
    const Shell here = mean_of(reach, reach + 3), beyond = mean_of(reach + 3, 2 * reach + 11);
    if (here.count < kFewestPixels || beyond.count < kFewestPixels) return std::nullopt;
    if (here.detail < kNearlyAll * beyond.detail) continue;
    const bool is_taper = reach - first >= kShortestTaper_px &&
                          at_fill.detail < kMaxAtFill * beyond.detail &&
                          at_fill.difference < kMaxAtFill * beyond.difference;
    if (!is_taper) return std::nullopt;
    return static_cast<std::int64_t>(std::ceil(static_cast<double>(reach) / kNearlyAll)) + 1;
  }
  return std::nullopt;
}

}  // namespace

void mask_taper(const std::vector<std::uint8_t>& is_fill, double fill_value, MaskedImage* image) {
  const std::vector<float> distance = distances(is_fill, image->width, image->height);
  const auto reach = find_taper(sum_shells(*image, distance, fill_value));
  if (!reach) return;
  for (std::size_t i = 0; i < distance.size(); ++i)
    if (distance[i] <= static_cast<float>(*reach)) image->valid[i] = 0;
}

}  // namespace tomofield::tilt_series
