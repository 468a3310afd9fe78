#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "base/check.h"

namespace tomofield::base {

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

}  // namespace tomofield::base
