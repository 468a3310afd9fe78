#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/simd_target.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
const char* target_name() { return hwy::TargetName(HWY_TARGET); }
}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(target_name);
std::string simd_target_name() { return HWY_DYNAMIC_DISPATCH(target_name)(); }
}  // namespace tomofield::kernels
#endif
