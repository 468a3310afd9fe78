#include "fit/adam.h"

#include <cmath>

namespace tomofield::fit {

Adam::Adam(const field::Field& field, const AdamOptions& options) : options_(options) {
  state_.m.reset(field.num_parameters());
  state_.v.reset(field.num_parameters());
  state_.leaf_steps.assign(static_cast<std::size_t>(field.tree().num_leaves()), 0);
}

void Adam::step(field::Field& field, int leaf, base::AlignedBuffer<float>& gradient,
                double learning_rate) {
  const double t = static_cast<double>(++state_.leaf_steps[static_cast<std::size_t>(leaf)]);
  const std::size_t first = field.offset(leaf);
  const kernels::AdamStep step =
      kernels::corrected_step(options_.beta1, options_.beta2, learning_rate, t);
  kernels::adam_step(step, static_cast<std::ptrdiff_t>(field.offset(leaf + 1) - first),
                     field.parameters().data() + first, gradient.data() + first,
                     state_.m.data() + first, state_.v.data() + first);
}

void Adam::step_bias(field::Field& field, double gradient, double learning_rate) {
  const double t = static_cast<double>(++state_.bias_steps);
  state_.bias_m = options_.beta1 * state_.bias_m + (1 - options_.beta1) * gradient;
  state_.bias_v = options_.beta2 * state_.bias_v + (1 - options_.beta2) * gradient * gradient;
  const double m = state_.bias_m / (1 - std::pow(options_.beta1, t));
  const double v = state_.bias_v / (1 - std::pow(options_.beta2, t));
  field.bias -= static_cast<float>(learning_rate * m / (std::sqrt(v) + 1e-30));
}

}  // namespace tomofield::fit
