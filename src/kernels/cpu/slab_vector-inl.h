// Slab vectors for Highway kernels: the 16 rows of a sample as few registers
// as the target has. Included once per target by foreach_target.
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

// e^x for x <= 0 (−87 and below give about 1e-38). Range reduction by ln 2 in
// two parts, then Taylor to x^6 on |r| <= ln2/2: relative error below 3e-7.
HWY_INLINE Vec exp_of_negative(Vec x) {
  const Tag d;
  x = hn::Max(x, hn::Set(d, -87.0f));
  const Vec n = hn::Round(hn::Mul(x, hn::Set(d, 1.44269504f)));
  Vec r = hn::NegMulAdd(n, hn::Set(d, 0.693145751953125f), x);
  r = hn::NegMulAdd(n, hn::Set(d, 1.42860677e-6f), r);
  Vec p = hn::Set(d, 1.0f / 720);
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 120));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 24));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f / 6));
  p = hn::MulAdd(p, r, hn::Set(d, 0.5f));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f));
  p = hn::MulAdd(p, r, hn::Set(d, 1.0f));
  const auto exponent =
      hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(IntTag(), n), hn::Set(IntTag(), 127)));
  return hn::Mul(p, hn::BitCast(d, exponent));
}

// log(1 + t) for 0 <= t <= 1 as 2 atanh(t / (2 + t)); the argument of the odd
// series is at most 1/3, so six terms leave 2e-7.
HWY_INLINE Vec log1p_of_unit(Vec t) {
  const Tag d;
  const Vec s = hn::Div(t, hn::Add(t, hn::Set(d, 2.0f)));
  const Vec s2 = hn::Mul(s, s);
  Vec p = hn::Set(d, 2.0f / 13);
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f / 11));
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f / 9));
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f / 7));
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f / 5));
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f / 3));
  p = hn::MulAdd(p, s2, hn::Set(d, 2.0f));
  return hn::Mul(p, s);
}

// log(x) for finite x >= 1: exponent · ln 2 + log of the mantissa. Relative
// error below 3e-7.
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
