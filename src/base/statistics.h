#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "base/check.h"

namespace tomofield::base {

/// The standard deviation of normally distributed values over their median absolute deviation:
/// 1 / Φ⁻¹(3/4).
inline constexpr double kSigmaOfMedianDeviation = 1.4826;

/// Returns the value below which `percent` of the values lie, interpolated linearly between
/// neighbours as numpy does by default. Takes a copy, which it reorders. `values` must not be empty
/// and must not contain NaN.
template <typename Value = float>
double percentile(std::vector<Value> values, double percent) {
  TOMOFIELD_CHECK(!values.empty(), "percentile of nothing");
  const double position = percent / 100.0 * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::ptrdiff_t>(position);
  std::nth_element(values.begin(), values.begin() + low, values.end());
  const auto below = static_cast<double>(values[static_cast<std::size_t>(low)]);
  if (low + 1 == static_cast<std::ptrdiff_t>(values.size())) return below;
  const auto above = static_cast<double>(*std::min_element(values.begin() + low + 1, values.end()));
  return below + (above - below) * (position - static_cast<double>(low));
}

/// Returns the median, which is the mean of the two in the middle of an even number of values.
template <typename Value = float>
double median(std::vector<Value> values) {
  return percentile(std::move(values), 50);
}

/// Returns the median of `values`, the upper one of the two in the middle; 0 without values. The
/// values are in another order afterwards.
template <typename Value>
Value median_in_place(std::vector<Value>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the standard deviation that normally distributed values of the same median absolute
/// deviation have, which outliers hardly change; 0 without values. The values become their
/// distances from the median.
inline double robust_deviation_in_place(std::vector<float>& values) {
  const float middle = median_in_place(values);
  for (float& value : values) value = std::fabs(value - middle);
  return kSigmaOfMedianDeviation * static_cast<double>(median_in_place(values));
}

/// A mean over the views and its standard error.
struct MeanGain {
  double mean = 0.0, error = 0.0;

  bool exceeds(double standard_errors) const { return mean > standard_errors * error; }
};

/// Returns the mean of the gains of some views. Fewer than two tell nothing: their mean is 0.
inline MeanGain mean_gain(std::span<const double> gains) {
  const auto n = static_cast<double>(gains.size());
  if (gains.size() < 2) return {};
  double sum = 0.0, squares = 0.0;
  for (const double gain : gains) sum += gain;
  for (const double gain : gains) squares += std::pow(gain - sum / n, 2);
  return {sum / n, std::sqrt(squares / (n - 1) / n)};
}

}  // namespace tomofield::base
