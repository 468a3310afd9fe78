#include "kernels/leaf_decoding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/leaf_decoding.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

struct Softplus {
  Vec beta, inverse_beta;
  explicit Softplus(float b) : beta(hn::Set(Tag(), b)), inverse_beta(hn::Set(Tag(), 1.0f / b)) {}
  Vec operator()(Vec a) const {
    const Vec t = exp_of_negative(hn::Neg(hn::Mul(beta, hn::Abs(a))));
    return hn::MulAdd(log1p_of_unit(t), inverse_beta, hn::Max(a, hn::Zero(Tag())));
  }
  Vec derivative(Vec f) const {
    return hn::Sub(hn::Set(Tag(), 1.0f), exp_of_negative(hn::Neg(hn::Mul(beta, f))));
  }
};

struct Identity {
  Vec operator()(Vec a) const { return a; }
  Vec derivative(Vec) const { return hn::Set(Tag(), 1.0f); }
};

HWY_INLINE Vec interpolate(Vec lower, Vec upper, Vec fraction) {
  return hn::MulAdd(fraction, hn::Sub(upper, lower), lower);
}

// `column` holds one x position's vertex values interpolated in x, [z, lane].
template <class Act>
HWY_INLINE void decode(const LeafPiece& p, const Act& act, const float* values, float* column,
                       float* samples) {
  const Tag d;
  const std::ptrdiff_t column_size = static_cast<std::ptrdiff_t>(p.num_vertices_z) * kLanes;
  for (int x = 0; x < p.x.count; ++x) {
    const float* lower = values + p.x.lower[x] * column_size;
    const Vec fx = hn::Set(d, p.x.fraction[x]);
    for (std::ptrdiff_t i = 0; i < column_size; i += kVecLanes) {
      hn::Store(interpolate(hn::LoadU(d, lower + i), hn::LoadU(d, lower + column_size + i), fx), d,
                column + i);
    }
    for (int z = 0; z < p.z.count; ++z) {
      const float* c = column + static_cast<std::ptrdiff_t>(p.z.lower[z]) * kLanes;
      const Vec fz = hn::Set(d, p.z.fraction[z]);
      float* out = samples + z * p.stride_z + static_cast<std::ptrdiff_t>(x) * kLanes;
      for (int v = 0; v < kLanes; v += kVecLanes) {
        hn::StoreU(act(interpolate(hn::Load(d, c + v), hn::Load(d, c + kLanes + v), fz)), d,
                   out + v);
      }
    }
  }
}

template <class Act>
HWY_INLINE double decode_adjoint(const LeafPiece& p, const Act& act, const float* samples,
                                 const float* grad_samples, float* column, float* grad_values) {
  const Tag d;
  const std::ptrdiff_t column_size = static_cast<std::ptrdiff_t>(p.num_vertices_z) * kLanes;
  double bias = 0.0;
  for (int x = 0; x < p.x.count; ++x) {
    std::fill_n(column, column_size, 0.0f);
    Vec sum = hn::Zero(d);
    for (int z = 0; z < p.z.count; ++z) {
      float* c = column + static_cast<std::ptrdiff_t>(p.z.lower[z]) * kLanes;
      const Vec fz = hn::Set(d, p.z.fraction[z]);
      const std::ptrdiff_t at = z * p.stride_z + static_cast<std::ptrdiff_t>(x) * kLanes;
      for (int v = 0; v < kLanes; v += kVecLanes) {
        const Vec g = hn::Mul(hn::LoadU(d, grad_samples + at + v),
                              act.derivative(hn::LoadU(d, samples + at + v)));
        const Vec upper = hn::Mul(g, fz);
        sum = hn::Add(sum, g);
        hn::Store(hn::Add(hn::Load(d, c + v), hn::Sub(g, upper)), d, c + v);
        hn::Store(hn::Add(hn::Load(d, c + kLanes + v), upper), d, c + kLanes + v);
      }
    }
    bias += static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum)));
    float* lower = grad_values + p.x.lower[x] * column_size;
    const Vec fx = hn::Set(d, p.x.fraction[x]);
    for (std::ptrdiff_t i = 0; i < column_size; i += kVecLanes) {
      const Vec g = hn::Load(d, column + i);
      const Vec upper = hn::Mul(g, fx);
      hn::StoreU(hn::Add(hn::LoadU(d, lower + i), hn::Sub(g, upper)), d, lower + i);
      hn::StoreU(hn::Add(hn::LoadU(d, lower + column_size + i), upper), d, lower + column_size + i);
    }
  }
  return bias;
}

void decode_leaf(const LeafPiece& piece, const float* values, float* column, float* samples) {
  if (piece.activation.beta > 0) {
    decode(piece, Softplus(piece.activation.beta), values, column, samples);
  } else {
    decode(piece, Identity(), values, column, samples);
  }
}

double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* column, float* grad_values) {
  if (piece.activation.beta > 0) {
    return decode_adjoint(piece, Softplus(piece.activation.beta), samples, grad_samples, column,
                          grad_values);
  }
  return decode_adjoint(piece, Identity(), samples, grad_samples, column, grad_values);
}

void activate_softplus(float beta, float* values, std::ptrdiff_t count) {
  const Tag d;
  const Softplus act(beta);
  std::ptrdiff_t i = 0;
  for (; i + kVecLanes <= count; i += kVecLanes)
    hn::StoreU(act(hn::LoadU(d, values + i)), d, values + i);
  HWY_ALIGN float rest[kVecLanes] = {};
  std::copy(values + i, values + count, rest);
  hn::Store(act(hn::Load(d, rest)), d, rest);
  std::copy_n(rest, count - i, values + i);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(decode_leaf);
HWY_EXPORT(decode_leaf_adjoint);
HWY_EXPORT(activate_softplus);

namespace {
float* scratch_column(const LeafPiece& piece) {
  thread_local base::AlignedBuffer<float> column;
  column.reserve(static_cast<std::size_t>(piece.num_vertices_z) * kLanes);
  return column.data();
}
}  // namespace

void decode_leaf(const LeafPiece& piece, const float* values, float* samples) {
  HWY_DYNAMIC_DISPATCH(decode_leaf)(piece, values, scratch_column(piece), samples);
}

double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* grad_values) {
  return HWY_DYNAMIC_DISPATCH(decode_leaf_adjoint)(piece, samples, grad_samples,
                                                   scratch_column(piece), grad_values);
}

void activate(Activation activation, float* values, std::ptrdiff_t count) {
  if (activation.beta > 0) HWY_DYNAMIC_DISPATCH(activate_softplus)(activation.beta, values, count);
}
}  // namespace tomofield::kernels
#endif
