#pragma once

#include <string>

namespace tomofield::kernels {

/// Returns the name of the instruction set that the kernels use on this machine, as Highway calls
/// it ("AVX3" is AVX-512).
std::string simd_target_name();

}  // namespace tomofield::kernels
