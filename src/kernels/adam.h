#pragma once

#include <cmath>
#include <cstddef>

namespace tomofield::kernels {

/// One step of Adam (Kingma and Ba 2015) on parameters p with gradient g and moments m, v:
///
///   m ← β1 m + (1 − β1) g;  v ← β2 v + (1 − β2) g²;  p ← p − rate_m m / (√v · rate_v + ε)
///
/// rate_m = learning rate / (1 − β1^t) and rate_v = 1 / √(1 − β2^t) contain the bias corrections.
struct AdamStep {
  float beta1 = 0.9f, beta2 = 0.99f;
  float rate_m = 0.0f, rate_v = 1.0f;
  float epsilon = 1e-12f;
};

/// Returns the t-th step (t ≥ 1) with its bias corrections.
inline AdamStep corrected_step(double beta1, double beta2, double learning_rate, double t) {
  AdamStep step;
  step.beta1 = static_cast<float>(beta1);
  step.beta2 = static_cast<float>(beta2);
  step.rate_m = static_cast<float>(learning_rate / (1 - std::pow(beta1, t)));
  step.rate_v = static_cast<float>(1 / std::sqrt(1 - std::pow(beta2, t)));
  return step;
}

/// Applies a step to `count` parameters and sets their gradient to zero, because the next step
/// accumulates into it. Memory traffic: 32 bytes a parameter.
void adam_step(const AdamStep& step, std::ptrdiff_t count, float* parameters, float* gradient,
               float* m, float* v);

}  // namespace tomofield::kernels
