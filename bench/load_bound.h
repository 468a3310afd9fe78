#pragma once

#include <cstddef>

namespace tomofield::bench {

/// Does the loads and FMAs of a gather and nothing else, so that no gather can be faster. Each of
/// `count` updates loads two slab samples of 64 bytes from `samples` and multiplies them into an
/// accumulator that stays in registers. `samples` has `size` floats and is walked repeatedly.
/// Returns a number that depends on all loads, so that the compiler keeps them.
float load_two_samples(const float* samples, std::size_t size, std::ptrdiff_t count);

}  // namespace tomofield::bench
