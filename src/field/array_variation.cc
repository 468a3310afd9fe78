#include "field/array_variation.h"

#include <cmath>
#include <cstddef>

namespace tomofield::field {

double array_variation(const float* values, int n0, int n1, int n2, int channels,
                       const kernels::VariationPenalty& penalty, double weight, float* gradient) {
  const std::ptrdiff_t stride2 = channels;
  const std::ptrdiff_t stride1 = stride2 * n2;
  const std::ptrdiff_t stride0 = stride1 * n1;
  const float tau = penalty.concavity;
  const float epsilon2 = penalty.epsilon * penalty.epsilon;
  double value = 0.0;
  for (int i = 0; i < n0; ++i) {
    for (int j = 0; j < n1; ++j) {
      for (int k = 0; k < n2; ++k) {
        const std::ptrdiff_t at = i * stride0 + j * stride1 + k * stride2;
        const std::ptrdiff_t up0 = i + 1 < n0 ? stride0 : 0;
        const std::ptrdiff_t up1 = j + 1 < n1 ? stride1 : 0;
        const std::ptrdiff_t up2 = k + 1 < n2 ? stride2 : 0;
        for (std::ptrdiff_t c = at; c < at + channels; ++c) {
          const float d0 = values[c + up0] - values[c];
          const float d1 = values[c + up1] - values[c];
          const float d2 = values[c + up2] - values[c];
          const float m = std::sqrt(d0 * d0 + d1 * d1 + d2 * d2 + epsilon2);
          value += static_cast<double>(tau > 0 ? tau * std::log1p(m / tau) : m);
          const float slope = static_cast<float>(weight) / (m * (tau > 0 ? 1.0f + m / tau : 1.0f));
          gradient[c + up0] += slope * d0;
          gradient[c + up1] += slope * d1;
          gradient[c + up2] += slope * d2;
          gradient[c] -= slope * (d0 + d1 + d2);
        }
      }
    }
  }
  return weight * value;
}

}  // namespace tomofield::field
