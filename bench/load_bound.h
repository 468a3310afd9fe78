#pragma once

#include <cstddef>

namespace tomofield::bench {

/// What no gather can beat: for each of `count` updates two slab samples (64
/// bytes each) loaded from `samples`, `size` floats that are walked round and
/// round, and multiplied into an accumulator that stays in registers.
/// Returns a number that depends on all of them.
float load_two_samples(const float* samples, std::size_t size, std::ptrdiff_t count);

}  // namespace tomofield::bench
