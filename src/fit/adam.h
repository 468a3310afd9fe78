#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/field.h"
#include "kernels/adam.h"

namespace tomofield::fit {

struct AdamOptions {
  double beta1 = 0.9;
  double beta2 = 0.99;
};

/// Adam over the leaves of a field and its decoder's bias. Moments are lazy: a
/// leaf's advance, and its bias correction counts, only when a step touches it.
class Adam {
 public:
  Adam(const field::Field& field, const AdamOptions& options);

  /// One step on the listed leaves; their gradient is used up (zeroed).
  void step(field::Field& field, const std::vector<int>& leaves,
            base::AlignedBuffer<float>& gradient, double learning_rate);
  /// One step on the bias, which every ray shares and which so moves slowly.
  void step_bias(field::Field& field, double gradient, double learning_rate);

  /// The whole state, for checkpoints.
  struct State {
    base::AlignedBuffer<float> m, v;
    std::vector<std::int64_t> leaf_steps;
    double bias_m = 0.0, bias_v = 0.0;
    std::int64_t bias_steps = 0;
  };
  State& state() { return state_; }
  const State& state() const { return state_; }

 private:
  AdamOptions options_;
  State state_;
};

}  // namespace tomofield::fit
