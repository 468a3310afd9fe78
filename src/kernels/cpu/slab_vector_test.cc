#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "simd_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/slab_vector_test.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

void exp2_of_all(float* values) {
  for (int i = 0; i < kLanes; i += kVecLanes) {
    hn::StoreU(exp2_of_negative(hn::LoadU(Tag(), values + i)), Tag(), values + i);
  }
}

void log1p_of_all(float* values) {
  for (int i = 0; i < kLanes; i += kVecLanes) {
    hn::StoreU(log1p_of_unit(hn::LoadU(Tag(), values + i)), Tag(), values + i);
  }
}

void log_of_all(float* values) {
  for (int i = 0; i < kLanes; i += kVecLanes) {
    hn::StoreU(log_above_one(hn::LoadU(Tag(), values + i)), Tag(), values + i);
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(exp2_of_all);
HWY_EXPORT(log1p_of_all);
HWY_EXPORT(log_of_all);

namespace {

// The test takes every kStride-th float of [first, last] by bit pattern, so all binades alike. The
// same bounds hold with stride 1, for all floats (run once by hand, 2026).
constexpr std::uint32_t kStride = 4999;

struct Worst {
  double error = 0.0;
  float at = 0.0f;
};

template <typename Function, typename Expected>
Worst worst_relative_error(float first, float last, float sign, Function function,
                           Expected expected) {
  Worst worst;
  const std::uint32_t end = std::bit_cast<std::uint32_t>(last);
  for (std::uint32_t bits = std::bit_cast<std::uint32_t>(first); bits <= end;) {
    float x[kLanes], y[kLanes];
    for (int i = 0; i < kLanes; ++i, bits += kStride) {
      x[i] = y[i] = sign * std::bit_cast<float>(std::min(bits, end));
    }
    function(y);
    for (int i = 0; i < kLanes; ++i) {
      const double truth = expected(static_cast<double>(x[i]));
      // The error is relative to at least the smallest normal number: denormals have few bits.
      const double error =
          std::abs(static_cast<double>(y[i]) - truth) / std::max(std::abs(truth), 0x1p-126);
      if (!(error <= worst.error)) worst = {error, x[i]};
    }
  }
  return worst;
}

TEST(SlabVector, PowersOfTwo) {
  testing::for_each_simd_target([] {
    const auto fast = [](float* x) { HWY_DYNAMIC_DISPATCH(exp2_of_all)(x); };
    const Worst worst =
        worst_relative_error(0.0f, 126.0f, -1.0f, fast, [](double x) { return std::exp2(x); });
    EXPECT_LE(worst.error, 3e-7) << "at " << worst.at;
    float ends[kLanes] = {0.0f, -1e30f};
    fast(ends);
    EXPECT_EQ(ends[0], 1.0f);
    EXPECT_EQ(ends[1], 0x1p-126f);
  });
}

TEST(SlabVector, LogarithmOnTheUnitInterval) {
  testing::for_each_simd_target([] {
    const auto fast = [](float* x) { HWY_DYNAMIC_DISPATCH(log1p_of_all)(x); };
    const Worst worst =
        worst_relative_error(0.0f, 1.0f, 1.0f, fast, [](double x) { return std::log1p(x); });
    EXPECT_LE(worst.error, 3e-7) << "at " << worst.at;
  });
}

TEST(SlabVector, LogarithmOfAnyNumberAboveOne) {
  testing::for_each_simd_target([] {
    const auto fast = [](float* x) { HWY_DYNAMIC_DISPATCH(log_of_all)(x); };
    const Worst worst =
        worst_relative_error(1.0f, 3e38f, 1.0f, fast, [](double x) { return std::log(x); });
    EXPECT_LE(worst.error, 3e-7) << "at " << worst.at;
  });
}

}  // namespace
}  // namespace tomofield::kernels
#endif
