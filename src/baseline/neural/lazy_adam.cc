#include "baseline/neural/lazy_adam.h"

#include <algorithm>

#include "base/parallel.h"
#include "kernels/adam.h"

namespace tomofield::baseline {
namespace {

constexpr std::size_t kBlock = 64;            // parameters that share the count of their steps
constexpr std::size_t kBlocksOfThread = 256;  // blocks that a thread takes at once

}  // namespace

LazyAdam::LazyAdam(std::size_t num_parameters)
    : gradient_(num_parameters),
      m_(num_parameters),
      v_(num_parameters),
      steps_((num_parameters + kBlock - 1) / kBlock) {}

void LazyAdam::step(double learning_rate, std::span<float> parameters) {
  const std::size_t parts = (steps_.size() + kBlocksOfThread - 1) / kBlocksOfThread;
  base::parallel_for(static_cast<std::int64_t>(parts), [&](std::int64_t part) {
    const std::size_t first = static_cast<std::size_t>(part) * kBlocksOfThread;
    const std::size_t end = std::min(first + kBlocksOfThread, steps_.size());
    for (std::size_t b = first; b < end; ++b) step_block(b, learning_rate, parameters);
  });
}

void LazyAdam::step_block(std::size_t block, double learning_rate, std::span<float> parameters) {
  const std::size_t first = block * kBlock;
  const std::size_t count = std::min(kBlock, gradient_.size() - first);
  const std::span<float> gradient = std::span(gradient_).subspan(first, count);
  if (std::ranges::all_of(gradient, [](float g) { return g == 0.0f; })) return;
  const kernels::AdamStep usual;
  const kernels::AdamStep step =
      kernels::corrected_step(usual.beta1, usual.beta2, learning_rate, ++steps_[block]);
  kernels::adam_step(step, static_cast<std::ptrdiff_t>(count), parameters.data() + first,
                     gradient.data(), m_.data() + first, v_.data() + first);
}

}  // namespace tomofield::baseline
