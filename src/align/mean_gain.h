#pragma once

#include <cmath>
#include <span>

namespace tomofield::alignment {

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

}  // namespace tomofield::alignment
