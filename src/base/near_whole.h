#pragma once

#include <cmath>

namespace tomofield::base {

/// Returns the whole number that a ratio of two pixel sizes, or its inverse, is but for the digits
/// of a size: headers round it to 7. Other ratios stay as they are.
inline double whole_if_near(double ratio) {
  constexpr double kRounding = 1e-5;
  const double inverse = 1 / ratio;
  if (std::fabs(ratio - std::round(ratio)) <= kRounding * ratio) return std::round(ratio);
  if (std::fabs(inverse - std::round(inverse)) <= kRounding * inverse)
    return 1 / std::round(inverse);
  return ratio;
}

}  // namespace tomofield::base
