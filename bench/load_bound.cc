#include "bench/load_bound.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/load_bound.cc"
#include <hwy/foreach_target.h>
// Highway requires that foreach_target.h is included before other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

float load_two_samples(const float* samples, std::size_t size, std::ptrdiff_t count) {
  const Tag d;
  // Eight independent sums hide the latency of the additions.
  constexpr int kSums = kVecs >= 8 ? 1 : 8 / kVecs;
  Vec sums[kSums][kVecs];
  for (auto& sum : sums)
    for (Vec& v : sum) v = hn::Zero(d);
  const Vec lower = hn::Set(d, 0.25f), upper = hn::Set(d, 0.75f);
  const float* const end = samples + size;
  const float* p = samples;
  for (std::ptrdiff_t i = 0; i < count; i += kSums) {
    for (auto& sum : sums) {
      for (int v = 0; v < kVecs; ++v) {
        sum[v] = hn::MulAdd(lower, hn::LoadU(d, p + v * kVecLanes), sum[v]);
        sum[v] = hn::MulAdd(upper, hn::LoadU(d, p + kLanes + v * kVecLanes), sum[v]);
      }
      p += 2 * kLanes;
    }
    if (p >= end) p = samples;
  }
  Vec total = hn::Zero(d);
  for (const auto& sum : sums)
    for (const Vec& v : sum) total = hn::Add(total, v);
  return hn::GetLane(hn::SumOfLanes(d, total));
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(load_two_samples);
}  // namespace tomofield::kernels

namespace tomofield::bench {
float load_two_samples(const float* samples, std::size_t size, std::ptrdiff_t count) {
  using namespace tomofield::kernels;
  return HWY_DYNAMIC_DISPATCH(load_two_samples)(samples, size, count);
}
}  // namespace tomofield::bench
#endif
