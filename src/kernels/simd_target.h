#pragma once

#include <string>

namespace tomofield::kernels {

/// Name of the instruction set that the kernels run on here, as Highway calls
/// it ("AVX3" is AVX-512).
std::string simd_target_name();

}  // namespace tomofield::kernels
