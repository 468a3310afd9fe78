#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tomofield::base {

/// Returns the median of `values`, the upper one of the two in the middle; 0 without values. The
/// values are in another order afterwards.
inline float median_in_place(std::vector<float>& values) {
  if (values.empty()) return 0.0f;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Returns the standard deviation that normally distributed values of the same median absolute
/// deviation have, which outliers hardly change; 0 without values. The values become their
/// distances from the median.
inline double robust_deviation_in_place(std::vector<float>& values) {
  constexpr double kSigmaOfMedianDeviation = 1.4826;  // 1 / Φ⁻¹(3/4)
  const float median = median_in_place(values);
  for (float& value : values) value = std::fabs(value - median);
  return kSigmaOfMedianDeviation * static_cast<double>(median_in_place(values));
}

}  // namespace tomofield::base
