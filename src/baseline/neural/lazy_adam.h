#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"

namespace tomofield::baseline {

/// Adam (kernels/adam.h) for parameters of which a step may touch few, such as those of a hash
/// grid. A block of parameters whose gradient is zero keeps its values and its moments. Otherwise
/// it would drift on while nothing is known about it (as in Müller et al. 2022, section 4).
class LazyAdam {
 public:
  explicit LazyAdam(std::size_t num_parameters);

  /// Returns the gradient of the next step. It is zero at first and after each step.
  std::span<float> gradient() { return gradient_; }
  void step(double learning_rate, std::span<float> parameters);

 private:
  void step_block(std::size_t block, double learning_rate, std::span<float> parameters);

  base::AlignedBuffer<float> gradient_, m_, v_;
  std::vector<std::int32_t> steps_;  // [block]
};

}  // namespace tomofield::baseline
