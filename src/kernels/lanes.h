#pragma once

namespace tomofield::kernels {

/// The number of consecutive detector rows in a slab. The row y is the SIMD lane and the innermost
/// index of every slab array. 16 floats are one AVX-512 register, two AVX2 registers, and one cache
/// line.
inline constexpr int kLanes = 16;

}  // namespace tomofield::kernels
