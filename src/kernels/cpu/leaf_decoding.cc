#include "kernels/leaf_decoding.h"

#include <algorithm>
#include <utility>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/leaf_decoding.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

// Returns true if all samples lie at vertices, as they do for vertices one pixel apart. They then
// need no interpolation.
inline bool are_at_vertices(const AxisTaps& axis) {
  return std::all_of(axis.fraction, axis.fraction + axis.count,
                     [](float fraction) { return fraction == 0.0f || fraction == 1.0f; });
}
inline bool are_at_vertices(const LeafPiece& p) {
  return are_at_vertices(p.x) && are_at_vertices(p.z);
}
inline int vertex_at(const AxisTaps& axis, int sample) {
  return axis.lower[sample] + static_cast<int>(axis.fraction[sample]);
}

struct Softplus {
  Vec per_log2, inverse_beta;  // e^(−βa) = 2^(per_log2 a)
  explicit Softplus(float beta)
      : per_log2(hn::Set(Tag(), -1.44269504f * beta)), inverse_beta(hn::Set(Tag(), 1.0f / beta)) {}
  Vec operator()(Vec a) const {
    const Vec t = exp2_of_negative(hn::Mul(per_log2, hn::Abs(a)));
    return hn::MulAdd(log1p_of_unit(t), inverse_beta, hn::Max(a, hn::Zero(Tag())));
  }
  Vec derivative(Vec f) const {
    return hn::Sub(hn::Set(Tag(), 1.0f), exp2_of_negative(hn::Mul(per_log2, f)));
  }
};

struct Identity {
  Vec operator()(Vec a) const { return a; }
  Vec derivative(Vec) const { return hn::Set(Tag(), 1.0f); }
};

HWY_INLINE void add_to(Vec sum, float* to) {
  hn::StoreU(hn::Add(hn::LoadU(Tag(), to), sum), Tag(), to);
}

// Calls visit(vertex, sample) for every vector of a row whose samples lie at vertices. Both are
// counted in floats from the first.
template <class Visit>
HWY_INLINE void for_each_at_vertices(const LeafPiece& p, int z, const Visit& visit) {
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(p.num_vertices_z) * kLanes;
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(vertex_at(p.z, z)) * kLanes;
  for (int x = 0; x < p.x.count; ++x) {
    for (int v = 0; v < kLanes; v += kVecLanes)
      visit(vertex_at(p.x, x) * column + row + v, static_cast<std::ptrdiff_t>(x) * kLanes + v);
  }
}

// The bound for 16 samples is a load from L2, a store to L3, and the activation.
template <class Act>
HWY_INLINE void decode_at_vertices(const LeafPiece& p, const Act& act, const float* values,
                                   float* samples) {
  const Tag d;
  for (int z = 0; z < p.z.count; ++z, samples += p.stride_z) {
    for_each_at_vertices(p, z, [&](std::ptrdiff_t vertex, std::ptrdiff_t sample) HWY_ATTR {
      hn::StoreU(act(hn::LoadU(d, values + vertex)), d, samples + sample);
    });
  }
}

// The bound for 16 samples is two loads from L3, a load and a store of L2, and about 12 operations.
template <class Act>
HWY_INLINE double decode_adjoint_at_vertices(const LeafPiece& p, const Act& act,
                                             const float* samples, const float* grad_samples,
                                             float* grad_values) {
  const Tag d;
  double bias = 0.0;
  for (int z = 0; z < p.z.count; ++z, samples += p.stride_z, grad_samples += p.stride_z) {
    Vec sum = hn::Zero(d);
    for_each_at_vertices(p, z, [&](std::ptrdiff_t vertex, std::ptrdiff_t sample) HWY_ATTR {
      const Vec g = hn::Mul(hn::LoadU(d, grad_samples + sample),
                            act.derivative(hn::LoadU(d, samples + sample)));
      sum = hn::Add(sum, g);
      add_to(g, grad_values + vertex);
    });
    bias += static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum)));
  }
  return bias;
}

HWY_INLINE Vec interpolate(Vec lower, Vec upper, Vec fraction) {
  return hn::MulAdd(fraction, hn::Sub(upper, lower), lower);
}

// Two neighbouring rows of vertex values, already interpolated in x. Rows of samples are decoded
// between them, one after the other, while the pair moves up through the leaf.
struct RowPair {
  float* lower;  // vertex row `index`, [x, lane]
  float* upper;  // vertex row index + 1
  int index = -2;
  RowPair(const LeafPiece& piece, float* scratch)
      : lower(scratch), upper(scratch + static_cast<std::ptrdiff_t>(piece.x.count) * kLanes) {}
};

HWY_INLINE void interpolate_row(const LeafPiece& p, const float* values, int z, float* row) {
  const Tag d;
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(p.num_vertices_z) * kLanes;
  values += static_cast<std::ptrdiff_t>(z) * kLanes;
  for (int x = 0; x < p.x.count; ++x, row += kLanes) {
    const float* lower = values + p.x.lower[x] * column;
    const Vec fx = hn::Set(d, p.x.fraction[x]);
    for (int v = 0; v < kLanes; v += kVecLanes) {
      hn::Store(interpolate(hn::LoadU(d, lower + v), hn::LoadU(d, lower + column + v), fx), d,
                row + v);
    }
  }
}

HWY_INLINE void move_to(const LeafPiece& p, const float* values, int z, RowPair& rows) {
  if (z == rows.index) return;
  if (z == rows.index + 1) {
    std::swap(rows.lower, rows.upper);
  } else {
    interpolate_row(p, values, z, rows.lower);
  }
  interpolate_row(p, values, z + 1, rows.upper);
  rows.index = z;
}

// The bound for 16 samples is two loads from L1, a store to L3, where a slab lies, and about 25
// operations of softplus, which are 13 cycles of two ports. All samples between two vertices in z
// share the rows' interpolation in x. With as many vertices as samples in z, it adds
// two loads and two operations a sample.
template <class Act>
HWY_INLINE void decode(const LeafPiece& p, const Act& act, const float* values, float* scratch,
                       float* samples) {
  if (are_at_vertices(p)) return decode_at_vertices(p, act, values, samples);
  const Tag d;
  const std::ptrdiff_t row_size = static_cast<std::ptrdiff_t>(p.x.count) * kLanes;
  RowPair rows(p, scratch);
  for (int z = 0; z < p.z.count; ++z, samples += p.stride_z) {
    move_to(p, values, p.z.lower[z], rows);
    const Vec fz = hn::Set(d, p.z.fraction[z]);
    for (std::ptrdiff_t i = 0; i < row_size; i += kVecLanes) {
      const Vec a = interpolate(hn::Load(d, rows.lower + i), hn::Load(d, rows.upper + i), fz);
      hn::StoreU(act(a), d, samples + i);
    }
  }
}

// Applies the adjoint of interpolate_row: adds the row to the gradient of its vertices and sets it
// to zero. The contributions of neighbouring samples to a vertex are summed in registers.
HWY_INLINE void spread_row(const LeafPiece& p, float* row, int z, float* grad_values) {
  const Tag d;
  const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(p.num_vertices_z) * kLanes;
  grad_values += static_cast<std::ptrdiff_t>(z) * kLanes;
  for (int v = 0; v < kLanes; v += kVecLanes) {
    Vec low = hn::Zero(d), high = hn::Zero(d);  // sums for vertices `at` and at + 1
    int at = p.x.lower[0];
    for (int x = 0; x < p.x.count; ++x) {
      if (p.x.lower[x] != at) {
        add_to(low, grad_values + at * column + v);
        low = high;
        high = hn::Zero(d);
        if (p.x.lower[x] != at + 1) {
          add_to(low, grad_values + (at + 1) * column + v);
          low = high;
        }
        at = p.x.lower[x];
      }
      float* const g = row + static_cast<std::ptrdiff_t>(x) * kLanes + v;
      const Vec upper = hn::Mul(hn::Load(d, g), hn::Set(d, p.x.fraction[x]));
      low = hn::Add(low, hn::Sub(hn::Load(d, g), upper));
      high = hn::Add(high, upper);
      hn::Store(hn::Zero(d), d, g);
    }
    add_to(low, grad_values + at * column + v);
    add_to(high, grad_values + (at + 1) * column + v);
  }
}

// The bound for 16 samples is two loads from L3, four loads and two stores of L1, and about 16
// operations.
template <class Act>
HWY_INLINE double decode_adjoint(const LeafPiece& p, const Act& act, const float* samples,
                                 const float* grad_samples, float* scratch, float* grad_values) {
  if (are_at_vertices(p))
    return decode_adjoint_at_vertices(p, act, samples, grad_samples, grad_values);
  const Tag d;
  const std::ptrdiff_t row_size = static_cast<std::ptrdiff_t>(p.x.count) * kLanes;
  RowPair rows(p, scratch);
  std::fill_n(scratch, 2 * row_size, 0.0f);
  double bias = 0.0;
  for (int z = 0; z < p.z.count; ++z, samples += p.stride_z, grad_samples += p.stride_z) {
    if (p.z.lower[z] != rows.index) {
      if (z > 0) spread_row(p, rows.lower, rows.index, grad_values);
      if (z > 0 && p.z.lower[z] != rows.index + 1) {
        spread_row(p, rows.upper, rows.index + 1, grad_values);
      }
      std::swap(rows.lower, rows.upper);
      rows.index = p.z.lower[z];
    }
    const Vec fz = hn::Set(d, p.z.fraction[z]);
    Vec sum = hn::Zero(d);
    for (std::ptrdiff_t i = 0; i < row_size; i += kVecLanes) {
      const Vec g =
          hn::Mul(hn::LoadU(d, grad_samples + i), act.derivative(hn::LoadU(d, samples + i)));
      const Vec upper = hn::Mul(g, fz);
      sum = hn::Add(sum, g);
      hn::Store(hn::Add(hn::Load(d, rows.lower + i), hn::Sub(g, upper)), d, rows.lower + i);
      hn::Store(hn::Add(hn::Load(d, rows.upper + i), upper), d, rows.upper + i);
    }
    bias += static_cast<double>(hn::GetLane(hn::SumOfLanes(d, sum)));
  }
  spread_row(p, rows.lower, rows.index, grad_values);
  spread_row(p, rows.upper, rows.index + 1, grad_values);
  return bias;
}

void decode_leaf(const LeafPiece& piece, const float* values, float* scratch, float* samples) {
  if (piece.activation.beta > 0) {
    decode(piece, Softplus(piece.activation.beta), values, scratch, samples);
  } else {
    decode(piece, Identity(), values, scratch, samples);
  }
}

double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* scratch, float* grad_values) {
  if (piece.activation.beta > 0) {
    return decode_adjoint(piece, Softplus(piece.activation.beta), samples, grad_samples, scratch,
                          grad_values);
  }
  return decode_adjoint(piece, Identity(), samples, grad_samples, scratch, grad_values);
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
float* scratch_rows(const LeafPiece& piece) {
  thread_local base::AlignedBuffer<float> rows;
  rows.reserve(2 * static_cast<std::size_t>(piece.x.count) * kLanes);
  return rows.data();
}
}  // namespace

void decode_leaf(const LeafPiece& piece, const float* values, float* samples) {
  HWY_DYNAMIC_DISPATCH(decode_leaf)(piece, values, scratch_rows(piece), samples);
}

double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* grad_values) {
  return HWY_DYNAMIC_DISPATCH(decode_leaf_adjoint)(piece, samples, grad_samples,
                                                   scratch_rows(piece), grad_values);
}

void activate(Activation activation, float* values, std::ptrdiff_t count) {
  if (activation.beta > 0) HWY_DYNAMIC_DISPATCH(activate_softplus)(activation.beta, values, count);
}
}  // namespace tomofield::kernels
#endif
