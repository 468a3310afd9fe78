#pragma once

#include <string>

namespace tomofield::kernels {

/// The number of consecutive detector rows in a slab. The row y is the SIMD lane and the innermost
/// index of every slab array. 16 floats are one AVX-512 register, two AVX2 registers, and one cache
/// line.
inline constexpr int kLanes = 16;

/// Returns the name of the instruction set that the kernels use on this machine, as Highway calls
/// it ("AVX3" is AVX-512).
std::string simd_target_name();

}  // namespace tomofield::kernels
