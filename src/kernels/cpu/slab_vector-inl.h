// Slab vectors for Highway kernels: the 16 rows of a sample in as few registers as the target
// allows. foreach_target includes this file once per target.
#if defined(TOMOFIELD_KERNELS_CPU_SLAB_VECTOR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TOMOFIELD_KERNELS_CPU_SLAB_VECTOR_INL_H_
#undef TOMOFIELD_KERNELS_CPU_SLAB_VECTOR_INL_H_
#else
#define TOMOFIELD_KERNELS_CPU_SLAB_VECTOR_INL_H_
#endif

#include <hwy/highway.h>

#include "kernels/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<float, kLanes>;
using Vec = hn::Vec<Tag>;
using IntTag = hn::RebindToSigned<Tag>;
constexpr int kVecLanes = static_cast<int>(hn::MaxLanes(Tag()));
constexpr int kVecs = kLanes / kVecLanes;

// Returns c[0] + c[1] x + c[2] x² + …
template <int kCount>
HWY_INLINE Vec polynomial(Vec x, const float (&c)[kCount]) {
  Vec sum = hn::Set(Tag(), c[kCount - 1]);
  for (int i = kCount - 2; i >= 0; --i) sum = hn::MulAdd(sum, x, hn::Set(Tag(), c[i]));
  return sum;
}

// Returns 2^x for x <= 0; −126 and below give 2^−126. x is split into n + r with |r| <= 1/2. The
// low bits of x + 1.5 · 2^23 hold the integer n. A minimax polynomial that is exact at 0 gives 2^r.
// The relative error is below 3e-7.
HWY_INLINE Vec exp2_of_negative(Vec x) {
  const Tag d;
  const IntTag di;
  const Vec shift = hn::Set(d, 12582912.0f);
  x = hn::Max(x, hn::Set(d, -126.0f));
  const Vec shifted = hn::Add(x, shift);
  const Vec r = hn::Sub(x, hn::Sub(shifted, shift));
  const Vec p = polynomial(
      r, {1.0f, 0.693146978f, 0.240222421f, 0.0555073374f, 0.00967151275f, 0.00132647273f});
  return hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::BitCast(di, shifted))));
}

// Returns log(1 + t) for 0 <= t <= 1, as t times a minimax polynomial that is exact at 0. The
// relative error is below 3e-7.
HWY_INLINE Vec log1p_of_unit(Vec t) {
  return hn::Mul(t, polynomial(t, {1.0f, -0.49999648f, 0.333213226f, -0.248571636f, 0.191536547f,
                                   -0.137538017f, 0.0792045266f, -0.0300657857f, 0.00536482241f}));
}

// Returns log(x) for finite x >= 1, as exponent · ln 2 + log of the mantissa. The relative error is
// below 3e-7.
HWY_INLINE Vec log_above_one(Vec x) {
  const Tag d;
  const IntTag di;
  const auto bits = hn::BitCast(di, x);
  const auto exponent = hn::Sub(hn::ShiftRight<23>(bits), hn::Set(di, 127));
  const auto mantissa = hn::Or(hn::And(bits, hn::Set(di, 0x7fffff)), hn::Set(di, 0x3f800000));
  return hn::MulAdd(hn::ConvertTo(d, exponent), hn::Set(d, 0.693147181f),
                    log1p_of_unit(hn::Sub(hn::BitCast(d, mantissa), hn::Set(d, 1.0f))));
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
