#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

namespace tomofield::base {

/// Returns the weights of a Gaussian blur at whole pixels, which add up to 1. `sigma_px` is its
/// standard deviation, above 0; the weights end `reach` standard deviations from the middle one.
inline std::vector<float> gaussian_kernel(double sigma_px, double reach) {
  const auto last = static_cast<std::int64_t>(std::ceil(reach * sigma_px));
  std::vector<float> kernel;
  double sum = 0.0;
  for (std::int64_t i = -last; i <= last; ++i) {
    const double at = static_cast<double>(i) / sigma_px;
    kernel.push_back(static_cast<float>(std::exp(-0.5 * at * at)));
    sum += static_cast<double>(kernel.back());
  }
  for (float& weight : kernel) weight = static_cast<float>(static_cast<double>(weight) / sum);
  return kernel;
}

}  // namespace tomofield::base
