#include "baseline/neural/noise_levels.h"

#include <algorithm>
#include <cmath>

namespace tomofield::baseline {

double NoiseLevels::sigma(std::size_t view) const {
  return start_[view] * std::exp(log_ratio_[view]);
}

void NoiseLevels::step(std::span<const double> counts, std::span<const double> squares,
                       double rate) {
  constexpr double kMaxExcess = 2.0;  // residuals far above their level must not make it overshoot
  for (std::size_t v = 0; v < start_.size(); ++v) {
    if (counts[v] == 0) continue;
    const double excess = squares[v] / (counts[v] * sigma(v) * sigma(v)) - 1;
    log_ratio_[v] += rate / 2 * std::min(excess, kMaxExcess);
  }
}

double NoiseLevels::objective(std::span<const double> counts,
                              std::span<const double> squares) const {
  double sum = 0;
  for (std::size_t v = 0; v < start_.size(); ++v)
    sum += squares[v] / (2 * sigma(v) * sigma(v)) + counts[v] * log_ratio_[v];
  return sum;
}

}  // namespace tomofield::baseline
