#include "tilt_series/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/statistics.h"
#include "tilt_series/resampling/binning.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::size_t kMinDifferences = 64;
// Rows of larger images are left out: the median of this number of sizes is right within a
// part in a thousand.
constexpr std::int64_t kEnoughDifferences = 1 << 20;

/// Returns the standard deviation that rounding to steps of the smallest difference makes, or what
/// all differences leave for it, as where nearly all of them are 0.
double sigma_of_rounding(const std::vector<float>& differences) {
  double step = std::numeric_limits<double>::infinity(), squares = 0.0;
  for (const float difference : differences) {
    const double size = std::fabs(static_cast<double>(difference));
    if (size > 0.0) step = std::min(step, size);
    squares += size * size;
  }
  if (!std::isfinite(step)) return 0.0;
  return std::min(step / std::sqrt(12.0),
                  std::sqrt(squares / static_cast<double>(differences.size())) / 2.0);
}

/// Returns the estimate from mixed second differences at the image's own scale; 0 if there are too
/// few. Where most of them are 0, as with few grey levels, rounding is what is known.
double sigma_of_differences(const MaskedImage& image) {
  const std::int64_t row_step =
      std::max<std::int64_t>(1, image.width * image.height / kEnoughDifferences);
  std::vector<float> differences;
  for (std::int64_t y = 0; y + 1 < image.height; y += row_step) {
    for (std::int64_t x = 0; x + 1 < image.width; ++x) {
      const std::size_t here = image.index(x, y), above = image.index(x, y + 1);
      if (!(image.valid[here] && image.valid[here + 1] && image.valid[above] &&
            image.valid[above + 1])) {
        continue;
      }
      differences.push_back(image.values[here] - image.values[here + 1] - image.values[above] +
                            image.values[above + 1]);
    }
  }
  if (differences.size() < kMinDifferences) return 0.0;
  const double of_rounding = sigma_of_rounding(differences);
  return std::max(base::robust_deviation_in_place(differences) / 2.0, of_rounding);
}

double standard_deviation(const MaskedImage& image) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!image.valid[i]) continue;
    sum += image.values[i];
    count += 1.0;
  }
  if (count == 0.0) return 0.0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (image.valid[i]) squares += std::pow(image.values[i] - sum / count, 2);
  }
  return std::sqrt(squares / count);
}

}  // namespace

double estimate_noise_sigma(const MaskedImage& view) {
  const double at_one = sigma_of_differences(view);
  const MaskedImage half = reduce_image(view, 2.0);
  const double at_two = 2.0 * sigma_of_differences(half);
  const double at_four = 4.0 * sigma_of_differences(reduce_image(half, 2.0));
  // at_four / at_two <= at_two / at_one, without dividing by zero
  const bool levels_off = at_four * at_one <= at_two * at_two;
  // Linear interpolation half-way between pixels makes the ratio 1.6 or more. Structure of the
  // specimen makes it up to 1.3, and must not count as noise in some views by chance.
  constexpr double kLeastRatioOfColouredNoise = 1.4;
  const bool is_coloured = at_two > kLeastRatioOfColouredNoise * at_one && levels_off;
  const double sigma = is_coloured ? at_two : at_one;
  constexpr double kSmallestPart = 1e-3;
  return std::max({sigma, kSmallestPart * standard_deviation(view),
                   static_cast<double>(std::numeric_limits<float>::min())});
}

}  // namespace tomofield::tilt_series
