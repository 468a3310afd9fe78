#include "baseline/classical/tilt_weights.h"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <numeric>

namespace tomofield::baseline {

std::vector<double> tilt_weights(const std::vector<double>& tilt_deg) {
  const std::size_t n = tilt_deg.size();
  if (n == 1) return {std::numbers::pi};
  std::vector<std::size_t> by_tilt(n);
  std::iota(by_tilt.begin(), by_tilt.end(), std::size_t{0});
  std::ranges::stable_sort(by_tilt, {}, [&](std::size_t view) { return tilt_deg[view]; });
  const auto tilt = [&](std::size_t i) { return tilt_deg[by_tilt[i]]; };
  const double range = tilt(n - 1) - tilt(0);
  const double beyond = std::clamp(180.0 - range, 0.0, range / static_cast<double>(n - 1));
  std::vector<double> weights(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double before = i > 0 ? tilt(i) - tilt(i - 1) : beyond;
    const double after = i + 1 < n ? tilt(i + 1) - tilt(i) : beyond;
    weights[by_tilt[i]] = (before + after) / 2 * std::numbers::pi / 180;
  }
  return weights;
}

}  // namespace tomofield::baseline
