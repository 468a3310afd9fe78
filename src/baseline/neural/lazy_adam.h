#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"

namespace tomofield::baseline {

/// Adam (kernels/adam.h) on parameters of which a step may touch few, as those of a hash grid:
/// blocks of parameters whose gradient is zero stay where they are, and their moments too, so
/// that they do not drift on while nothing is known about them (as in Müller et al. 2022, §4).
class LazyAdam {
 public:
  explicit LazyAdam(std::size_t num_parameters);

  /// Zero at first and after each step: what the next one goes by.
  std::span<float> gradient() { return gradient_; }
  void step(double learning_rate, std::span<float> parameters);

 private:
  void step_block(std::size_t block, double learning_rate, std::span<float> parameters);

  base::AlignedBuffer<float> gradient_, m_, v_;
  std::vector<std::int32_t> steps_;  // of each block
};

}  // namespace tomofield::baseline
