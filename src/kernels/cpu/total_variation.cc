#include "kernels/total_variation.h"

#include <algorithm>
#include <cmath>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/total_variation.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

// Lane masks as 0/1 factors: rows of the volume, and rows that have a next one.
struct RowMasks {
  HWY_ALIGN float is_row[kLanes];
  HWY_ALIGN float has_next[kLanes];
  explicit RowMasks(const SlabVariation& s) {
    for (int l = 0; l < kLanes; ++l) {
      is_row[l] = l < s.num_rows ? 1.0f : 0.0f;
      has_next[l] = l + 1 < s.num_rows || (l + 1 == s.num_rows && s.above != nullptr) ? 1.0f : 0.0f;
    }
  }
};

// The value of kTermsPerLog concave terms is one logarithm of their product,
// which holds factors 1 + m/τ up to 4e9.
constexpr int kTermsPerLog = 4;

class Penalty {
 public:
  explicit Penalty(const SlabVariation& s)
      : concave_(s.penalty.concavity > 0),
        tau_(s.penalty.concavity),
        epsilon2_(hn::Set(Tag(), s.penalty.epsilon * s.penalty.epsilon)),
        per_tau_(hn::Set(Tag(), concave_ ? 1.0f / s.penalty.concavity : 0.0f)),
        weight_(hn::Set(Tag(), s.weight)) {}

  // weight φ′(m)/m for |∇f|² = square; adds φ(m) where `rows` is 1.
  HWY_INLINE Vec slope(Vec square, Vec rows) {
    const Tag d;
    const Vec m = hn::Sqrt(hn::Add(square, epsilon2_));
    const Vec factor = hn::MulAdd(m, per_tau_, hn::Set(d, 1.0f));
    if (concave_) {
      product_ = hn::Mul(product_, hn::MulAdd(hn::Mul(m, per_tau_), rows, hn::Set(d, 1.0f)));
      if (++terms_ == kTermsPerLog) take_logarithm();
    } else {
      sum_ = hn::MulAdd(m, rows, sum_);
    }
    return hn::Mul(rows, hn::Div(weight_, hn::Mul(m, factor)));
  }

  HWY_INLINE void end_row() {
    take_logarithm();
    value_ += static_cast<double>(hn::GetLane(hn::SumOfLanes(Tag(), sum_)));
    sum_ = hn::Zero(Tag());
  }
  // Σ φ over all rows that have ended.
  double value() const { return concave_ ? static_cast<double>(tau_) * value_ : value_; }

 private:
  HWY_INLINE void take_logarithm() {
    sum_ = hn::Add(sum_, log_above_one(product_));
    product_ = hn::Set(Tag(), 1.0f);
    terms_ = 0;
  }
  bool concave_;
  float tau_;
  Vec epsilon2_, per_tau_, weight_;
  Vec sum_ = hn::Zero(Tag());
  Vec product_ = hn::Set(Tag(), 1.0f);
  int terms_ = 0;
  double value_ = 0.0;
};

// Fluxes of one z row, [x, lane]; one more sample in front so that x − 1 and
// lane − 1 can be read without a test.
struct FluxRow {
  float* x;
  float* y;
  float* z;
};

// Density one row up (y + 1): the next lane, and past the last lane `above`.
HWY_INLINE Vec next_row(const float* sample, int v, const float* above, std::ptrdiff_t at) {
  const Tag d;
  const Vec next = hn::LoadU(d, sample + v + 1);
  if (v + kVecLanes < kLanes) return next;
  return hn::IfThenElse(hn::FirstN(d, kVecLanes - 1), next,
                        hn::Set(d, above != nullptr ? above[at] : 0.0f));
}

HWY_INLINE void compute_fluxes(const SlabVariation& s, const RowMasks& masks, int z,
                               Penalty& penalty, FluxRow out) {
  const Tag d;
  const float* row = s.samples + z * s.stride_z;
  const std::ptrdiff_t up = z + 1 < s.nz ? s.stride_z : 0;
  const Vec per_hx = hn::Set(d, s.per_hx), per_hz = hn::Set(d, s.per_hz);
  for (int x = 0; x < s.nx; ++x) {
    const float* p = row + static_cast<std::ptrdiff_t>(x) * kLanes;
    const std::ptrdiff_t right = x + 1 < s.nx ? kLanes : 0;
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(x) * s.nz + z;
    const std::ptrdiff_t to = static_cast<std::ptrdiff_t>(x) * kLanes;
    for (int v = 0; v < kLanes; v += kVecLanes) {
      const Vec f = hn::LoadU(d, p + v);
      const Vec rows = hn::Load(d, masks.is_row + v);
      const Vec dx = hn::Mul(per_hx, hn::Sub(hn::LoadU(d, p + right + v), f));
      const Vec dz = hn::Mul(per_hz, hn::Sub(hn::LoadU(d, p + up + v), f));
      const Vec dy =
          hn::Mul(hn::Load(d, masks.has_next + v), hn::Sub(next_row(p, v, s.above, at), f));
      const Vec slope =
          penalty.slope(hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz))), rows);
      hn::StoreU(hn::Mul(slope, hn::Mul(per_hx, dx)), d, out.x + to + v);
      hn::StoreU(hn::Mul(slope, dy), d, out.y + to + v);
      hn::StoreU(hn::Mul(slope, hn::Mul(per_hz, dz)), d, out.z + to + v);
    }
  }
  penalty.end_row();
}

// gradient += −div(flux), with the flux into the first lane from the row below.
HWY_INLINE void add_divergence(const SlabVariation& s, int z, FluxRow now, const float* z_before) {
  const Tag d;
  float* row = s.gradient + z * s.stride_z;
  for (int x = 0; x < s.nx; ++x) {
    float* g = row + static_cast<std::ptrdiff_t>(x) * kLanes;
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(x) * kLanes;
    float& below = s.flux[static_cast<std::ptrdiff_t>(x) * s.nz + z];
    const float last = now.y[at + s.num_rows - 1];
    // Lane −1 of this sample is lane 15 of the one before it, already read.
    now.y[at - 1] = below;
    below = last;
    for (int v = 0; v < kLanes; v += kVecLanes) {
      const Vec in =
          hn::Add(hn::LoadU(d, now.x + at - kLanes + v),
                  hn::Add(hn::LoadU(d, now.y + at - 1 + v), hn::LoadU(d, z_before + at + v)));
      const Vec out = hn::Add(hn::LoadU(d, now.x + at + v),
                              hn::Add(hn::LoadU(d, now.y + at + v), hn::LoadU(d, now.z + at + v)));
      hn::StoreU(hn::Add(hn::LoadU(d, g + v), hn::Sub(in, out)), d, g + v);
    }
  }
}

double slab_variation(const SlabVariation& s, float* scratch) {
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(s.nx + 1) * kLanes;
  std::fill_n(scratch, 4 * row, 0.0f);
  FluxRow now{scratch + kLanes, scratch + row + kLanes, scratch + 2 * row + kLanes};
  float* z_before = scratch + 3 * row + kLanes;
  const RowMasks masks(s);
  Penalty penalty(s);
  for (int z = 0; z < s.nz; ++z) {
    compute_fluxes(s, masks, z, penalty, now);
    add_divergence(s, z, now, z_before);
    std::swap(now.z, z_before);
  }
  return static_cast<double>(s.weight) * penalty.value();
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(slab_variation);

double slab_variation(const SlabVariation& slab) {
  thread_local base::AlignedBuffer<float> scratch;
  scratch.reserve(4 * static_cast<std::size_t>(slab.nx + 1) * kLanes);
  return HWY_DYNAMIC_DISPATCH(slab_variation)(slab, scratch.data());
}

void row_flux(const SlabVariation& s, const float* row, const float* next, float* flux) {
  const float tau = s.penalty.concavity;
  for (int x = 0; x < s.nx; ++x) {
    const std::ptrdiff_t right = x + 1 < s.nx ? s.nz : 0;
    for (int z = 0; z < s.nz; ++z) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(x) * s.nz + z;
      const float f = row[at];
      const float dx = s.per_hx * (row[at + right] - f);
      const float dz = s.per_hz * (row[at + (z + 1 < s.nz ? 1 : 0)] - f);
      const float dy = next[at] - f;
      const float m =
          std::sqrt(dx * dx + dy * dy + dz * dz + s.penalty.epsilon * s.penalty.epsilon);
      flux[at] = s.weight * dy / (m * (tau > 0 ? 1.0f + m / tau : 1.0f));
    }
  }
}
}  // namespace tomofield::kernels
#endif
