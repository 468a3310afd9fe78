#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/field.h"
#include "kernels/adam.h"

namespace tomofield::fit {

/// The decay rates of the first and the second moment.
struct AdamOptions {
  double beta1 = 0.9;
  double beta2 = 0.99;
};

/// Optimises the parameters of a field's leaves and the bias of its decoder (Adam; Kingma and Ba
/// 2015). Each leaf counts its own steps: its moments and its bias correction advance only in its
/// own steps.
class Adam {
 public:
  Adam(const field::Field& field, const AdamOptions& options);

  /// Takes one step on a leaf and clears its gradient. `gradient` has one entry for each parameter
  /// of the field. Different leaves may be stepped at the same time.
  void step(field::Field& field, int leaf, base::AlignedBuffer<float>& gradient,
            double learning_rate);
  /// Takes one step on the bias; `gradient` is the derivative of the loss by it.
  void step_bias(field::Field& field, double gradient, double learning_rate);

  /// The whole state, for checkpoints and for changes of the tree.
  struct State {
    base::AlignedBuffer<float> m, v;       ///< moments of every parameter
    std::vector<std::int64_t> leaf_steps;  ///< steps that each leaf has taken part in
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
