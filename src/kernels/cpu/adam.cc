#include "kernels/adam.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/adam.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Computes 1 / √x and 1 / x from the processor's estimates (12 bits or more) and one step of
// Newton's method each, which doubles the number of bits. The result is accurate to float's
// rounding, at a third of the cost of square root and division.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V reciprocal_root(D d, V x) {
  const V y = hn::ApproximateReciprocalSqrt(x);
  const V xyy = hn::Mul(hn::Mul(x, y), y);
  return hn::Mul(y, hn::NegMulAdd(hn::Set(d, 0.5f), xyy, hn::Set(d, 1.5f)));
}
template <class D, class V = hn::Vec<D>>
HWY_INLINE V reciprocal(D d, V x) {
  const V y = hn::ApproximateReciprocal(x);
  return hn::Mul(y, hn::NegMulAdd(x, y, hn::Set(d, 2.0f)));
}

constexpr float kSmallestSquare = 1e-30f;  // smaller squares have roots below 1e-15: ε dominates

// The bound is memory traffic, because a field does not fit in a cache: four arrays are read and
// written, 32 bytes a parameter. The dozen operations and two estimates take less time.
template <class D>
HWY_INLINE void update(D d, const AdamStep& s, float* p, float* g, float* m, float* v) {
  const auto gradient = hn::LoadU(d, g);
  const auto mean =
      hn::MulAdd(hn::Set(d, s.beta1), hn::LoadU(d, m), hn::Mul(hn::Set(d, 1 - s.beta1), gradient));
  const auto square = hn::MulAdd(hn::Set(d, s.beta2), hn::LoadU(d, v),
                                 hn::Mul(hn::Set(d, 1 - s.beta2), hn::Mul(gradient, gradient)));
  const auto root =
      hn::Mul(square, reciprocal_root(d, hn::Max(square, hn::Set(d, kSmallestSquare))));
  const auto scale = hn::MulAdd(root, hn::Set(d, s.rate_v), hn::Set(d, s.epsilon));
  const auto change = hn::Mul(hn::Mul(mean, hn::Set(d, s.rate_m)), reciprocal(d, scale));
  hn::StoreU(hn::Sub(hn::LoadU(d, p), change), d, p);
  hn::StoreU(mean, d, m);
  hn::StoreU(square, d, v);
  hn::StoreU(hn::Zero(d), d, g);
}

void adam_step(const AdamStep& s, std::ptrdiff_t count, float* p, float* g, float* m, float* v) {
  const hn::ScalableTag<float> d;
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  std::ptrdiff_t i = 0;
  for (; i + lanes <= count; i += lanes) update(d, s, p + i, g + i, m + i, v + i);
  for (; i < count; ++i) update(hn::CappedTag<float, 1>(), s, p + i, g + i, m + i, v + i);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(adam_step);
void adam_step(const AdamStep& step, std::ptrdiff_t count, float* parameters, float* gradient,
               float* m, float* v) {
  HWY_DYNAMIC_DISPATCH(adam_step)(step, count, parameters, gradient, m, v);
}
}  // namespace tomofield::kernels
#endif
