#pragma once

#include <cmath>
#include <limits>

namespace tomofield::tilt_series {

/// Adds up values of which some are missing (NaN).
struct KnownMean {
  double sum = 0.0, count = 0.0;

  void add(double value) {
    if (std::isnan(value)) return;
    sum += value;
    count += 1.0;
  }
  /// Returns the mean, or NaN if there are fewer than `fewest` values.
  double get(double fewest) const {
    return count > 0.0 && count >= fewest ? sum / count : std::numeric_limits<double>::quiet_NaN();
  }
};

}  // namespace tomofield::tilt_series
