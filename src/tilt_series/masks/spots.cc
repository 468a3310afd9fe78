#include "tilt_series/masks/spots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "tilt_series/masks/spot_place.h"
#include "tilt_series/resampling/binning.h"

namespace tomofield::tilt_series {
namespace {

// Larger spots are reduced to this diameter in pixels: a finer image shows no more.
constexpr double kSearchDiameter = 5.0;

constexpr int kDirections = 16;
constexpr int kIgnoredDirections = 2;  // as many as a close neighbour takes
constexpr int kMinDirections = 8;      // at the image's edge
constexpr double kDistance = 1.25;     // of the discs that are compared, in diameters
constexpr float kMinMeasured = 0.6f;   // part of a disc

// Least spread, in standard deviations of the contrast, for images without noise.
constexpr double kMinSpread = 0.5;

constexpr float kUnknown = -std::numeric_limits<float>::infinity();

/// The pixels of a disc around the origin and the part of each that counts.
struct Disc {
  struct Pixel {
    std::int64_t x, y;
    float weight;
  };
  std::vector<Pixel> pixels;
  float total = 0.0f;

  explicit Disc(double radius) {
    const auto reach = static_cast<std::int64_t>(std::ceil(radius));
    for (std::int64_t y = -reach; y <= reach; ++y) {
      for (std::int64_t x = -reach; x <= reach; ++x) {
        const double distance = std::hypot(static_cast<double>(x), static_cast<double>(y));
        const auto weight = static_cast<float>(std::clamp(radius + 0.5 - distance, 0.0, 1.0));
        if (weight == 0.0f) continue;
        pixels.push_back({x, y, weight});
        total += weight;
      }
    }
  }
};

/// Describes the pixels of a row whose neighbour at an offset lies in the image.
struct Overlap {
  std::size_t first, count;  // x of the first pixel, and how many there are
  std::size_t neighbour;     // index of the neighbour of the first one
};

Overlap overlap(const MaskedImage& image, std::int64_t y, std::int64_t dx, std::int64_t dy) {
  const std::int64_t first = std::max<std::int64_t>(0, -dx);
  const std::int64_t end = std::min(image.width, image.width - dx);
  if (y + dy < 0 || y + dy >= image.height || first >= end) return {};
  return {static_cast<std::size_t>(first), static_cast<std::size_t>(end - first),
          image.index(first + dx, y + dy)};
}

/// Returns means of the disc around every pixel [y, x]; kUnknown where little was measured. Goes
/// through rows, so that the compiler makes vectors of pixels.
std::vector<float> disc_means(const MaskedImage& image, const Disc& disc) {
  std::vector<float> means(image.values.size(), kUnknown);
  base::parallel_for("disc means", image.height, [&](std::int64_t y) {
    const auto width = static_cast<std::size_t>(image.width);
    std::vector<float> sum(width), weight(width);
    for (const Disc::Pixel& pixel : disc.pixels) {
      const Overlap row = overlap(image, y, pixel.x, pixel.y);
      for (std::size_t i = 0; i < row.count; ++i) {
        const bool is_valid = image.valid[row.neighbour + i];
        sum[row.first + i] += is_valid ? pixel.weight * image.values[row.neighbour + i] : 0.0f;
        weight[row.first + i] += is_valid ? pixel.weight : 0.0f;
      }
    }
    float* mean = means.data() + image.index(0, y);
    for (std::size_t x = 0; x < width; ++x)
      if (weight[x] >= kMinMeasured * disc.total) mean[x] = sum[x] / weight[x];
  });
  return means;
}

/// Holds the largest values that were added for each pixel of a row, and how many there were.
struct Largest {
  explicit Largest(std::int64_t width) : count(static_cast<std::size_t>(width)) {
    for (auto& values : sorted) values.assign(count.size(), kUnknown);
  }
  std::array<std::vector<float>, kIgnoredDirections + 1> sorted;  // the largest one first
  std::vector<int> count;

  void add(const Overlap& row, const std::vector<float>& values) {
    for (std::size_t i = 0; i < row.count; ++i) {
      const std::size_t x = row.first + i;
      float value = values[row.neighbour + i];
      count[x] += value != kUnknown;
      for (std::vector<float>& larger : sorted) {
        const float smaller = std::min(larger[x], value);
        larger[x] = std::max(larger[x], value);
        value = smaller;
      }
    }
  }
};

/// Returns the contrast of every pixel [y, x], or kUnknown.
std::vector<float> contrasts(const MaskedImage& image, double diameter) {
  const std::vector<float> means = disc_means(image, Disc(diameter / 2));
  std::array<std::int64_t, kDirections> dx, dy;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kDirections;
    dx[i] = std::lround(kDistance * diameter * std::cos(angle));
    dy[i] = std::lround(kDistance * diameter * std::sin(angle));
  }
  std::vector<float> contrast(means.size(), kUnknown);
  base::parallel_for("contrasts", image.height, [&](std::int64_t y) {
    Largest around(image.width);
    for (std::size_t i = 0; i < kDirections; ++i)
      around.add(overlap(image, y, dx[i], dy[i]), means);
    const std::size_t first = image.index(0, y);
    for (std::size_t x = 0; x < around.count.size(); ++x) {
      const float centre = means[first + x];
      if (centre == kUnknown || around.count[x] < kMinDirections) continue;
      contrast[first + x] = centre - around.sorted.back()[x];
    }
  });
  return contrast;
}

/// Returns the spread of the known contrasts; 0 where nothing varies.
double spread_of(const std::vector<float>& contrast) {
  std::vector<float> known;
  double sum = 0.0, squares = 0.0;
  for (const float value : contrast) {
    if (value == kUnknown) continue;
    known.push_back(value);
    sum += static_cast<double>(value);
    squares += static_cast<double>(value) * static_cast<double>(value);
  }
  if (known.empty()) return 0.0;
  const double count = static_cast<double>(known.size());
  const double deviation = std::sqrt(std::max(squares / count - sum * sum / count / count, 0.0));
  return std::max(base::robust_deviation_in_place(known), kMinSpread * deviation);
}

/// Tells whether no pixel within `radius` is higher; the first of equal pixels counts.
bool is_peak(const MaskedImage& image, const std::vector<float>& contrast, std::int64_t x,
             std::int64_t y, std::int64_t radius) {
  const std::size_t here = image.index(x, y);
  for (std::int64_t py = std::max<std::int64_t>(y - radius, 0);
       py <= std::min(y + radius, image.height - 1); ++py) {
    for (std::int64_t px = std::max<std::int64_t>(x - radius, 0);
         px <= std::min(x + radius, image.width - 1); ++px) {
      const std::size_t at = image.index(px, py);
      if (contrast[at] > contrast[here] || (contrast[at] == contrast[here] && at < here)) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

std::vector<Spot> find_spots(const MaskedImage& image, double diameter_px, double min_strength) {
  const double factor = std::max(1.0, diameter_px / kSearchDiameter);
  const MaskedImage reduced = factor > 1.0 ? reduce_image(image, factor) : image;
  const double diameter = diameter_px / factor;
  const std::vector<float> contrast = contrasts(reduced, diameter);
  const double spread = spread_of(contrast);
  std::vector<Spot> spots;
  if (!(spread > 0.0)) return spots;
  const auto threshold = static_cast<float>(min_strength * spread);
  const std::int64_t radius = std::max<std::int64_t>(1, std::lround(diameter / 2));
  const double centre_x = static_cast<double>(reduced.width) / 2,
               centre_y = static_cast<double>(reduced.height) / 2;
  for (std::int64_t y = 1; y + 1 < reduced.height; ++y) {
    for (std::int64_t x = 1; x + 1 < reduced.width; ++x) {
      const std::size_t at = reduced.index(x, y);
      if (!(contrast[at] >= threshold) || !is_peak(reduced, contrast, x, y, radius)) continue;
      const double middle_x = static_cast<double>(x) + 0.5, middle_y = static_cast<double>(y) + 0.5;
      const auto place = spot_place(reduced, middle_x, middle_y, diameter);
      const auto [px, py] = place.value_or(std::array{middle_x, middle_y});
      const auto height = static_cast<double>(contrast[at]);
      spots.push_back({(px - centre_x) * factor + static_cast<double>(image.width) / 2,
                       (py - centre_y) * factor + static_cast<double>(image.height) / 2, height,
                       height / spread, place.has_value()});
    }
  }
  return spots;
}

}  // namespace tomofield::tilt_series
