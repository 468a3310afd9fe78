#include "kernels/total_variation.h"

#include <algorithm>
#include <cmath>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/total_variation.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

// Masks of the lanes that are rows of the volume, and of those that have a next row, as 0 or 1.
struct RowMasks {
  HWY_ALIGN float is_row[kLanes];
  HWY_ALIGN float has_next[kLanes];
  explicit RowMasks(const SlabVariation& s) {
    for (int l = 0; l < kLanes; ++l) {
      is_row[l] = l < s.num_rows ? 1.0f : 0.0f;
      has_next[l] =
          l + 1 < s.num_rows || (l + 1 == s.num_rows && s.above.data != nullptr) ? 1.0f : 0.0f;
    }
  }
};

// Computes Σ log of numbers of at least 1 as the logarithm of their product, held as mantissa and
// exponent. Numbers up to 2^31 can be multiplied kAtOnce times before the exponent has to be taken
// out.
class SumOfLogs {
 public:
  // This is explicit, because the compiler would not build a default one for the target.
  HWY_INLINE SumOfLogs() : product_(hn::Set(Tag(), 1.0f)), exponent_(hn::Zero(IntTag())) {}
  HWY_INLINE void multiply(Vec factor) {
    product_ = hn::Mul(product_, factor);
    if (++count_ == kAtOnce) take_exponent();
  }
  // Returns the sum and starts again.
  HWY_INLINE Vec take() {
    take_exponent();
    const Vec sum = hn::MulAdd(hn::ConvertTo(Tag(), exponent_), hn::Set(Tag(), 0.693147181f),
                               log_above_one(product_));
    exponent_ = hn::Zero(IntTag());
    product_ = hn::Set(Tag(), 1.0f);
    return sum;
  }

 private:
  static constexpr int kAtOnce = 4;
  HWY_INLINE void take_exponent() {
    const IntTag di;
    const auto bits = hn::BitCast(di, product_);
    exponent_ = hn::Add(exponent_, hn::Sub(hn::ShiftRight<23>(bits), hn::Set(di, 127)));
    product_ =
        hn::BitCast(Tag(), hn::Or(hn::And(bits, hn::Set(di, 0x7fffff)), hn::Set(di, 0x3f800000)));
    count_ = 0;
  }
  Vec product_;
  hn::Vec<IntTag> exponent_;
  int count_ = 0;
};

template <bool kConcave>
class Penalty {
 public:
  explicit Penalty(const SlabVariation& s)
      : tau_(s.penalty.concavity),
        epsilon2_(hn::Set(Tag(), s.penalty.epsilon * s.penalty.epsilon)),
        per_tau_(hn::Set(Tag(), kConcave ? 1.0f / s.penalty.concavity : 0.0f)),
        weight_(hn::Set(Tag(), s.weight)) {}

  Vec epsilon2() const { return epsilon2_; }

  // Returns weight φ′(m)/m = weight / (m + m²/τ) where `rows` is 1, and 0 elsewhere, for
  // square = |∇f|² + ε² = m². Adds φ(m) there to the value.
  HWY_INLINE Vec slope(Vec square, Vec rows) {
    const Vec m = hn::Sqrt(square);
    if (kConcave) {
      logs_.multiply(hn::MulAdd(hn::Mul(m, per_tau_), rows, hn::Set(Tag(), 1.0f)));
    } else {
      sum_ = hn::MulAdd(m, rows, sum_);
    }
    return hn::Div(hn::Mul(weight_, rows), hn::MulAdd(square, per_tau_, m));
  }

  HWY_INLINE void end_row() {
    const Vec sum = kConcave ? hn::Mul(hn::Set(Tag(), tau_), logs_.take()) : sum_;
    value_ += static_cast<double>(hn::GetLane(hn::SumOfLanes(Tag(), sum)));
    sum_ = hn::Zero(Tag());
  }
  // Returns Σ φ over all rows that have ended.
  double value() const { return value_; }

 private:
  float tau_;
  Vec epsilon2_, per_tau_, weight_;
  Vec sum_ = hn::Zero(Tag());
  SumOfLogs logs_;
  double value_ = 0.0;
};

// Moves lanes up by one across the vectors of a sample; lane 0 becomes `below`.
struct LaneShift {
  using Indices = decltype(hn::SetTableIndices(Tag(), static_cast<const int*>(nullptr)));
  Indices rotation;
  LaneShift() : rotation(rotate_by_one()) {}

  // Returns the previous value of the last lane.
  HWY_INLINE float apply(const Vec (&from)[kVecs], float below, Vec (&to)[kVecs]) const {
    const Tag d;
    const auto first = hn::FirstN(d, 1);
    Vec carry = hn::Set(d, below);
    for (int v = 0; v < kVecs; ++v) {
      const Vec rotated = hn::TableLookupLanes(from[v], rotation);
      to[v] = hn::IfThenElse(first, carry, rotated);
      carry = rotated;
    }
    return hn::GetLane(carry);
  }

 private:
  static Indices rotate_by_one() {
    HWY_ALIGN int lanes[kVecLanes];
    for (int l = 0; l < kVecLanes; ++l) lanes[l] = (l + kVecLanes - 1) % kVecLanes;
    return hn::SetTableIndices(Tag(), lanes);
  }
};

// Returns the density one row up (y + 1): that of the next lane, and `above` past the last lane.
HWY_INLINE Vec next_row(const float* sample, int v, float above) {
  const Tag d;
  const Vec next = hn::LoadU(d, sample + v * kVecLanes + 1);
  if (v + 1 < kVecs) return next;
  return hn::IfThenElse(hn::FirstN(d, kVecLanes - 1), next, hn::Set(d, above));
}

// Processes samples [first, end) of row z: gradient += −div(flux). flux_x holds the flux into the
// first sample from the one before; on return, it holds the flux out of the last. flux_z, [x,
// lane], holds the fluxes into the row from the one below; on return, those out of it.
//
// The bound for 16 samples with AVX-512 is eight loads and two stores; about 25 operations, of
// which square root and division keep their one port busy for some 36 cycles; and 16 bytes a sample
// from L3, where a slab lies, which takes as long. Replacing square root and division by estimates
// and a step of Newton's method therefore saved no time.
template <bool kConcave>
HWY_INLINE void add_row(const SlabVariation& s, const RowMasks& masks, const LaneShift& shift,
                        Penalty<kConcave>& penalty, int z, int first, int end, float* flux_x,
                        float* flux_z) {
  const Tag d;
  const SampleOrder order(s, kLanes, s.stride_z), flux_order(s, s.nz, 1);
  const SampleOrder above_order(s, s.above.step_x, s.above.step_z);
  const std::ptrdiff_t up = z + 1 < s.nz ? order.step_z : 0;
  const Vec per_hx2 = hn::Set(d, s.per_hx * s.per_hx), per_hz2 = hn::Set(d, s.per_hz * s.per_hz);
  Vec from_left[kVecs];
  for (int v = 0; v < kVecs; ++v) from_left[v] = hn::Load(d, flux_x + v * kVecLanes);
  for (int x = first; x < end; ++x, flux_z += kLanes) {
    const std::ptrdiff_t offset = order(x, z);
    const float* const sample = s.samples + offset;
    const float* const right = sample + (x + 1 < s.nx ? order.step_x : 0);
    const float above = s.above.data != nullptr ? s.above.data[above_order(x, z)] : 0.0f;
    Vec flux_y[kVecs], sum[kVecs];
    for (int v = 0; v < kVecs; ++v) {
      const std::ptrdiff_t lane = static_cast<std::ptrdiff_t>(v) * kVecLanes;
      const Vec f = hn::LoadU(d, sample + lane);
      const Vec dx = hn::Sub(hn::LoadU(d, right + lane), f);
      const Vec dz = hn::Sub(hn::LoadU(d, sample + up + lane), f);
      const Vec dy =
          hn::Mul(hn::Load(d, masks.has_next + lane), hn::Sub(next_row(sample, v, above), f));
      const Vec dx_h = hn::Mul(dx, per_hx2), dz_h = hn::Mul(dz, per_hz2);
      const Vec square =
          hn::MulAdd(dx, dx_h, hn::MulAdd(dy, dy, hn::MulAdd(dz, dz_h, penalty.epsilon2())));
      const Vec slope = penalty.slope(square, hn::Load(d, masks.is_row + lane));
      const Vec to_right = hn::Mul(slope, dx_h), to_top = hn::Mul(slope, dz_h);
      flux_y[v] = hn::Mul(slope, dy);
      const Vec in = hn::Add(from_left[v], hn::Load(d, flux_z + lane));
      sum[v] = hn::Sub(hn::Sub(in, to_right), hn::Add(to_top, flux_y[v]));
      from_left[v] = to_right;
      hn::Store(to_top, d, flux_z + lane);
    }
    Vec from_below[kVecs];
    float& flux = s.flux[flux_order(x, z)];
    flux = shift.apply(flux_y, flux, from_below);
    for (int v = 0; v < kVecs; ++v) {
      float* const g = s.gradient + offset + static_cast<std::ptrdiff_t>(v) * kVecLanes;
      hn::StoreU(hn::Add(hn::LoadU(d, g), hn::Add(sum[v], from_below[v])), d, g);
    }
  }
  for (int v = 0; v < kVecs; ++v) hn::Store(from_left[v], d, flux_x + v * kVecLanes);
  penalty.end_row();
}

// The fluxes between tiles of x. Within a tile, flux_z, [x, lane], is carried from row to row.
// flux_x, [z, lane], keeps the flux along x out of a tile for all rows.
struct Scratch {
  int tile;
  float *flux_z, *flux_x;
};

template <bool kConcave>
HWY_INLINE double variation(const SlabVariation& s, const Scratch& scratch) {
  const RowMasks masks(s);
  const LaneShift shift;
  Penalty<kConcave> penalty(s);
  std::fill_n(scratch.flux_x, static_cast<std::ptrdiff_t>(s.nz) * kLanes, 0.0f);
  for (int first = 0; first < s.nx; first += scratch.tile) {
    const int end = std::min(first + scratch.tile, s.nx);
    std::fill_n(scratch.flux_z, static_cast<std::ptrdiff_t>(end - first) * kLanes, 0.0f);
    for (int z = 0; z < s.nz; ++z) {
      add_row(s, masks, shift, penalty, z, first, end,
              scratch.flux_x + static_cast<std::ptrdiff_t>(z) * kLanes, scratch.flux_z);
    }
  }
  return static_cast<double>(s.weight) * penalty.value();
}

double slab_variation(const SlabVariation& s, int tile, float* flux_z, float* flux_x) {
  const Scratch scratch{tile, flux_z, flux_x};
  return s.penalty.concavity > 0 ? variation<true>(s, scratch) : variation<false>(s, scratch);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(slab_variation);

double slab_variation(const SlabVariation& slab) {
  constexpr std::size_t kTile = 128;  // two rows of samples, a flux and a gradient fit in L1
  thread_local base::AlignedBuffer<float> scratch;
  scratch.reserve((kTile + static_cast<std::size_t>(slab.nz)) * kLanes);
  return HWY_DYNAMIC_DISPATCH(slab_variation)(slab, static_cast<int>(kTile), scratch.data(),
                                              scratch.data() + kTile * kLanes);
}

void row_flux(const SlabVariation& s, const DensityRow& row, const DensityRow& next, float* flux) {
  const float tau = s.penalty.concavity;
  const SampleOrder order(s, row.step_x, row.step_z), next_order(s, next.step_x, next.step_z),
      flux_order(s, s.nz, 1);
  for (int x = 0; x < s.nx; ++x) {
    const std::ptrdiff_t right = x + 1 < s.nx ? order.step_x : 0;
    for (int z = 0; z < s.nz; ++z) {
      const float* const at = row.data + order(x, z);
      const float f = *at;
      const float dx = s.per_hx * (at[right] - f);
      const float dz = s.per_hz * (at[z + 1 < s.nz ? order.step_z : 0] - f);
      const float dy = next.data[next_order(x, z)] - f;
      const float m =
          std::sqrt(dx * dx + dy * dy + dz * dz + s.penalty.epsilon * s.penalty.epsilon);
      flux[flux_order(x, z)] = s.weight * dy / (m * (tau > 0 ? 1.0f + m / tau : 1.0f));
    }
  }
}
}  // namespace tomofield::kernels
#endif
