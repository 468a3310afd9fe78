#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// One step of Adam (Kingma and Ba 2015) on `count` parameters with moments m, v:
///   m ← β1 m + (1 − β1) g;  v ← β2 v + (1 − β2) g²;  p ← p − rate_m m / (√v · rate_v + ε)
/// rate_m = learning rate / (1 − β1^t) and rate_v = 1 / √(1 − β2^t) carry the bias
/// corrections. The gradient is zeroed on the way: the next step accumulates into it.
/// Traffic: 32 bytes a parameter.
struct AdamStep {
  float beta1 = 0.9f, beta2 = 0.99f;
  float rate_m = 0.0f, rate_v = 1.0f;
  float epsilon = 1e-12f;
};

void adam_step(const AdamStep& step, std::ptrdiff_t count, float* parameters, float* gradient,
               float* m, float* v);

}  // namespace tomofield::kernels
