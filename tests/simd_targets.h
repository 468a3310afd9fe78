#pragma once

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdint>

#include "kernels/lanes.h"

namespace tomofield::testing {

/// Runs `check` once for each SIMD target that the kernels were compiled for and this machine
/// supports. Restores the usual choice afterwards.
template <typename Check>
void for_each_simd_target(Check&& check) {
  struct Restore {
    ~Restore() { hwy::SetSupportedTargetsForTest(0); }
  } restore;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    SCOPED_TRACE(hwy::TargetName(target));
    // The kernels are compiled elsewhere: check that they use the same target.
    ASSERT_EQ(kernels::simd_target_name(), hwy::TargetName(target));
    check();
  }
}

}  // namespace tomofield::testing
