#include "tilt_series/intensity.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>

#include "tilt_series/resampling/binning.h"

namespace tomofield::tilt_series {
namespace {

// The parts of the block means that are not brighter than an empty place, in dark and in bright
// series.
constexpr double kEmptyBeamFraction = 0.995, kBackgroundFraction = 0.005;
constexpr double kMinTransmission = 1e-3;
constexpr std::int64_t kMaxBlock = 8;

/// Returns the values of all views, one view after another, on every process.
std::vector<float> gather(const std::vector<std::vector<float>>& values_of_views,
                          const distributed::Communicator& processes) {
  std::vector<std::int64_t> sizes;
  for (const auto& values : values_of_views) sizes.push_back(std::ssize(values));
  processes.allreduce_sum(std::span(sizes));
  std::vector<float> all(
      static_cast<std::size_t>(std::accumulate(sizes.begin(), sizes.end(), std::int64_t{0})));
  auto at = all.begin();
  for (std::size_t view = 0; view < values_of_views.size(); at += sizes[view++])
    std::ranges::copy(values_of_views[view], at);
  processes.allreduce_sum(std::span(all));
  return all;
}

// Returns the value of all views below which a fraction lies; 0 if there are no values.
double value_at(double fraction, const std::vector<std::vector<float>>& values_of_views,
                const distributed::Communicator& processes) {
  std::vector<float> values = gather(values_of_views, processes);
  if (values.empty()) return 0.0;
  const auto rank =
      static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(rank)]);
}

void subtract_background(double background, MaskedImage* image) {
  if (background == 0.0) return;
  for (std::size_t i = 0; i < image->values.size(); ++i)
    if (image->valid[i]) image->values[i] -= static_cast<float>(background);
}

}  // namespace

std::int64_t IntensityScale::convert(MaskedImage* image) const {
  if (contrast == Contrast::kBright) {
    subtract_background(background, image);
    return 0;
  }
  std::int64_t num_raised = 0;
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    if (!image->valid[i]) continue;
    float& value = image->values[i];
    if (!take_log) {
      value = static_cast<float>(empty_beam - value);
      continue;
    }
    const double transmission = (value + log_base) / (empty_beam + log_base);
    if (transmission < kMinTransmission) ++num_raised;
    value = static_cast<float>(-std::log(std::max(transmission, kMinTransmission)));
  }
  return num_raised;
}

void append_block_means(const MaskedImage& image, std::vector<float>* means) {
  const std::int64_t block =
      std::clamp<std::int64_t>(std::min(image.width, image.height) / 32, 1, kMaxBlock);
  const MaskedImage blocks = reduce_image(image, static_cast<double>(block));
  for (std::size_t i = 0; i < blocks.values.size(); ++i) {
    if (blocks.valid[i]) means->push_back(blocks.values[i]);
  }
}

double estimate_empty_beam(const std::vector<std::vector<float>>& means_of_views,
                           const distributed::Communicator& processes) {
  return value_at(kEmptyBeamFraction, means_of_views, processes);
}

double estimate_background(const std::vector<std::vector<float>>& means_of_views,
                           const distributed::Communicator& processes) {
  return value_at(kBackgroundFraction, means_of_views, processes);
}

}  // namespace tomofield::tilt_series
