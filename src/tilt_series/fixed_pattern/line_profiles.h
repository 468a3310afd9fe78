#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "tilt_series/image.h"

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

enum class Lines { kColumns, kRows };

constexpr std::size_t kLineParts = 16;

/// Profiles of the columns or rows of one view, one for each of kLineParts parts of their length:
/// [part][line]. NaN stands where most pixels of a part are no measurements.
using LineProfiles = std::vector<std::vector<float>>;

/// Returns how much each column (or row) lies above those around it, in each part of its length:
/// the mean over the part's pixels less a running median over up to 15 lines.
LineProfiles line_profiles(const MaskedImage& image, Lines lines);

}  // namespace tomofield::tilt_series
