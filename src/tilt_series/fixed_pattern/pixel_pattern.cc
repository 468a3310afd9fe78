#include "tilt_series/fixed_pattern/pixel_pattern.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/statistics.h"
#include "tilt_series/masks/bad_pixels.h"
#include "tilt_series/resampling/box_sums.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kReach = 2;       // of the pixels around
constexpr float kFewestAround = 12.0f;   // of 24
constexpr double kSteps = 16.0;          // a standard deviation
constexpr double kMostDeviations = 8.0;  // so that one view does not decide

/// Returns each pixel less the mean of the pixels around it. Pixels with too few measurements
/// around them are no measurements.
MaskedImage less_surroundings(const MaskedImage& image) {
  const std::vector<float> sums = box_sums(image.values, image.width, kReach);
  const std::vector<float> counts = box_sums(image.valid, image.width, kReach);
  MaskedImage result(image.width, image.height);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const float own = image.values[i], around = counts[i] - 1.0f;
    result.valid[i] = image.valid[i] && around >= kFewestAround;
    if (result.valid[i]) result.values[i] = own - (sums[i] - own) / around;
  }
  return result;
}

double deviation(const MaskedImage& differences) {
  double squares = 0.0, count = 0.0;
  for (std::size_t i = 0; i < differences.values.size(); ++i) {
    squares += static_cast<double>(differences.values[i]) * differences.values[i];
    count += differences.valid[i];
  }
  return count > 0.0 ? std::sqrt(squares / count) : 0.0;
}

/// Subtracts from `count` valid pixels, `stride` apart, their median.
void subtract_median(MaskedImage* image, std::size_t first, std::size_t stride,
                     std::int64_t count) {
  std::vector<float> values;
  const auto at = [&](std::int64_t i) { return first + static_cast<std::size_t>(i) * stride; };
  for (std::int64_t i = 0; i < count; ++i)
    if (image->valid[at(i)]) values.push_back(image->values[at(i)]);
  const float median = base::median_in_place(values);
  for (std::int64_t i = 0; i < count; ++i)
    if (image->valid[at(i)]) image->values[at(i)] -= median;
}

}  // namespace

PixelPattern::PixelPattern(std::int64_t width, std::int64_t height)
    : width_(width),
      height_(height),
      sums_(static_cast<std::size_t>(width * height)),
      counts_(sums_.size()) {}

void PixelPattern::add(const MaskedImage& image) {
  const MaskedImage differences = less_surroundings(image);
  const double one = deviation(differences);
  if (!(one > 0.0)) return;
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    if (!differences.valid[i]) continue;
    const double value = differences.values[i] / one;
    sums_[i] += static_cast<std::int32_t>(
        std::lround(kSteps * std::clamp(value, -kMostDeviations, kMostDeviations)));
    ++counts_[i];
  }
}

void PixelPattern::share(const distributed::Communicator& processes) {
  if (processes.size() == 1) return;
  for (std::vector<std::int32_t>* image : {&sums_, &counts_}) {
    for (auto row = image->begin(); row != image->end(); row += width_) {
      std::vector<std::int64_t> values(row, row + width_);
      processes.allreduce_sum(std::span(values));
      std::copy(values.begin(), values.end(), row);
    }
  }
}

std::vector<std::size_t> PixelPattern::find(std::size_t num_views,
                                            const distributed::Communicator& processes) {
  share(processes);
  MaskedImage mean(width_, height_);
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    mean.valid[i] = 2 * static_cast<std::size_t>(counts_[i]) >= num_views;
    if (mean.valid[i])
      mean.values[i] = static_cast<float>(sums_[i]) / static_cast<float>(counts_[i]);
  }
  // Columns and rows that differ as a whole are no single pixels.
  for (std::int64_t x = 0; x < width_; ++x)
    subtract_median(&mean, mean.index(x, 0), static_cast<std::size_t>(width_), height_);
  for (std::int64_t y = 0; y < height_; ++y) subtract_median(&mean, mean.index(0, y), 1, width_);
  const std::vector<std::uint8_t> before = mean.valid;
  mask_bad_pixels(&mean);
  std::vector<std::size_t> pixels;
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i] != mean.valid[i]) pixels.push_back(i);
  return pixels;
}

}  // namespace tomofield::tilt_series
