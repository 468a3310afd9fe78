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
  // square = |∇f|² + ε² = m².
  HWY_INLINE Vec slope(Vec square, Vec m, Vec rows) const {
    return hn::Div(hn::Mul(weight_, rows), hn::MulAdd(square, per_tau_, m));
  }
  // Adds φ(m) to the value where `rows` is 1.
  HWY_INLINE void add(Vec m, Vec rows) {
    if (kConcave) {
      logs_.multiply(hn::MulAdd(hn::Mul(m, per_tau_), rows, hn::Set(Tag(), 1.0f)));
    } else {
      sum_ = hn::MulAdd(m, rows, sum_);
    }
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

// The differences of a sample in a row of z, one vector of its lanes at a time.
class Differences {
 public:
  HWY_INLINE Differences(const SlabVariation& s, const RowMasks& masks, int z)
      : s_(s),
        masks_(masks),
        order_(s, kLanes, s.stride_z),
        above_order_(s, s.above.step_x, s.above.step_z),
        z_(z),
        up_(z + 1 < s.nz ? order_.step_z : 0),
        per_hx2_(hn::Set(Tag(), s.per_hx * s.per_hx)),
        per_hz2_(hn::Set(Tag(), s.per_hz * s.per_hz)) {}

  // Goes to a sample of the row.
  HWY_INLINE void move_to(int x) {
    offset_ = order_(x, z_);
    right_ = x + 1 < s_.nx ? order_.step_x : 0;
    above_ = s_.above.data != nullptr ? s_.above.data[above_order_(x, z_)] : 0.0f;
  }
  // Returns where the sample lies.
  HWY_INLINE std::ptrdiff_t offset() const { return offset_; }

  // D_x and D_z are divided by h², as the flux needs them.
  struct Of {
    Vec dx_h, dy, dz_h, square;
  };
  // Returns the differences of vector v, and |∇f|² + ε².
  HWY_INLINE Of of_vector(int v, Vec epsilon2) const {
    const Tag d;
    const std::ptrdiff_t lane = static_cast<std::ptrdiff_t>(v) * kVecLanes;
    const float* const sample = s_.samples + offset_;
    const Vec f = hn::LoadU(d, sample + lane);
    const Vec dx = hn::Sub(hn::LoadU(d, sample + right_ + lane), f);
    const Vec dz = hn::Sub(hn::LoadU(d, sample + up_ + lane), f);
    const Vec dy =
        hn::Mul(hn::Load(d, masks_.has_next + lane), hn::Sub(next_row(sample, v, above_), f));
    const Vec dx_h = hn::Mul(dx, per_hx2_), dz_h = hn::Mul(dz, per_hz2_);
    return {dx_h, dy, dz_h,
            hn::MulAdd(dx, dx_h, hn::MulAdd(dy, dy, hn::MulAdd(dz, dz_h, epsilon2)))};
  }

 private:
  const SlabVariation& s_;
  const RowMasks& masks_;
  SampleOrder order_, above_order_;
  int z_;
  std::ptrdiff_t up_, right_ = 0, offset_ = 0;
  float above_ = 0.0f;
  Vec per_hx2_, per_hz2_;
};

// Computes the flux along x out of sample x of row z; flux_x is [lane].
template <bool kConcave>
HWY_INLINE void flux_out_of(const SlabVariation& s, const RowMasks& masks,
                            const Penalty<kConcave>& penalty, int x, int z, float* flux_x) {
  const Tag d;
  Differences differences(s, masks, z);
  differences.move_to(x);
  for (int v = 0; v < kVecs; ++v) {
    const auto of = differences.of_vector(v, penalty.epsilon2());
    const Vec rows = hn::Load(d, masks.is_row + static_cast<std::ptrdiff_t>(v) * kVecLanes);
    const Vec slope = penalty.slope(of.square, hn::Sqrt(of.square), rows);
    hn::Store(hn::Mul(slope, of.dx_h), d, flux_x + v * kVecLanes);
  }
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
  const SampleOrder flux_order(s, s.nz, 1);
  Differences differences(s, masks, z);
  Vec from_left[kVecs];
  for (int v = 0; v < kVecs; ++v) from_left[v] = hn::Load(d, flux_x + v * kVecLanes);
  for (int x = first; x < end; ++x, flux_z += kLanes) {
    differences.move_to(x);
    Vec flux_y[kVecs], sum[kVecs];
    for (int v = 0; v < kVecs; ++v) {
      const std::ptrdiff_t lane = static_cast<std::ptrdiff_t>(v) * kVecLanes;
      const auto of = differences.of_vector(v, penalty.epsilon2());
      const Vec rows = hn::Load(d, masks.is_row + lane);
      const Vec m = hn::Sqrt(of.square);
      penalty.add(m, rows);
      const Vec slope = penalty.slope(of.square, m, rows);
      const Vec to_right = hn::Mul(slope, of.dx_h), to_top = hn::Mul(slope, of.dz_h);
      flux_y[v] = hn::Mul(slope, of.dy);
      const Vec in = hn::Add(from_left[v], hn::Load(d, flux_z + lane));
      sum[v] = hn::Sub(hn::Sub(in, to_right), hn::Add(to_top, flux_y[v]));
      from_left[v] = to_right;
      hn::Store(to_top, d, flux_z + lane);
    }
    Vec from_below[kVecs];
    float& flux = s.flux[flux_order(x, z)];
    flux = shift.apply(flux_y, flux, from_below);
    for (int v = 0; v < kVecs; ++v) {
      float* const g =
          s.gradient + differences.offset() + static_cast<std::ptrdiff_t>(v) * kVecLanes;
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
  for (int z = 0; z < s.nz && s.x.begin > 0; ++z) {
    flux_out_of(s, masks, penalty, s.x.begin - 1, z,
                scratch.flux_x + static_cast<std::ptrdiff_t>(z) * kLanes);
  }
  for (int first = s.x.begin; first < s.x.end; first += scratch.tile) {
    const int end = std::min(first + scratch.tile, s.x.end);
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

void clear_flux(const SlabVariation& s) {
  const SampleOrder order(s, s.nz, 1);
  for (int x = s.x.begin; x < s.x.end; ++x)
    for (int z = 0; z < s.nz; ++z) s.flux[order(x, z)] = 0.0f;
}

void row_flux(const SlabVariation& s, const DensityRow& row, const DensityRow& next, float* flux) {
  const float tau = s.penalty.concavity;
  const SampleOrder order(s, row.step_x, row.step_z), next_order(s, next.step_x, next.step_z),
      flux_order(s, s.nz, 1);
  for (int x = s.x.begin; x < s.x.end; ++x) {
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
