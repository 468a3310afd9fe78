#include "kernels/ray_samples.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/ray_samples.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {

using Ints = hn::Vec<IntTag>;

// The places of a vector of samples in a leaf: lower vertices, and the weights of the upper ones.
struct Taps {
  Ints lower;  // index of the corner with the lowest x, y and z
  Vec fx, fy, fz;
};

// Returns the lower vertex of positions along an axis and leaves the fraction in `position`.
HWY_INLINE Ints split(Vec& position, int num_vertices) {
  const IntTag di;
  const Vec last = hn::Set(Tag(), static_cast<float>(num_vertices - 1));
  position = hn::Min(hn::Max(position, hn::Zero(Tag())), last);
  const Ints lower =
      hn::Min(hn::Max(hn::ConvertTo(di, position), hn::Zero(di)), hn::Set(di, num_vertices - 2));
  position = hn::Sub(position, hn::ConvertTo(Tag(), lower));
  return lower;
}

HWY_INLINE Vec random_units(std::uint32_t key, int first) {
  const hn::RebindToUnsigned<Tag> du;
  const auto index = hn::Add(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(first)));
  auto x = hn::Add(hn::Set(du, key), hn::Mul(index, hn::Set(du, 0x9e3779b9U)));
  x = hn::Mul(hn::Xor(x, hn::ShiftRight<16>(x)), hn::Set(du, 0x7feb352dU));
  x = hn::Mul(hn::Xor(x, hn::ShiftRight<15>(x)), hn::Set(du, 0x846ca68bU));
  x = hn::ShiftRight<8>(hn::Xor(x, hn::ShiftRight<16>(x)));
  return hn::Mul(hn::ConvertTo(Tag(), hn::BitCast(IntTag(), x)), hn::Set(Tag(), 0x1p-24f));
}

HWY_INLINE Taps taps(const LeafVertices& leaf, const RayPiece& p, int first) {
  const Tag d;
  const IntTag di;
  const Vec index = hn::Add(hn::Iota(d, 0.0f), hn::Set(d, static_cast<float>(first)));
  const Vec t = hn::Mul(hn::Add(index, random_units(p.key, first)),
                        hn::Set(d, 1.0f / static_cast<float>(p.num_samples)));
  Taps at{hn::Zero(di), hn::MulAdd(t, hn::Set(d, p.span_x), hn::Set(d, p.start_x)),
          hn::MulAdd(t, hn::Set(d, p.span_y), hn::Set(d, p.start_y)),
          hn::MulAdd(t, hn::Set(d, p.span_z), hn::Set(d, p.start_z))};
  const Ints x = split(at.fx, leaf.nx), y = split(at.fy, leaf.ny), z = split(at.fz, leaf.nz);
  const Ints column = hn::Add(hn::Mul(x, hn::Set(di, leaf.nz)), z);
  at.lower = hn::Add(hn::Mul(column, hn::Set(di, leaf.ny)), y);
  return at;
}

HWY_INLINE Vec interpolate(Vec lower, Vec upper, Vec fraction) {
  return hn::MulAdd(fraction, hn::Sub(upper, lower), lower);
}

// Interpolates with eight gathers, which determine the cost: about 20 cycles each for 16 samples.
HWY_INLINE Vec sample(const LeafVertices& leaf, const float* values, const Taps& at) {
  const Tag d;
  const auto along_y = [&](std::ptrdiff_t column) {
    const float* from = values + column * leaf.ny;
    return interpolate(hn::GatherIndex(d, from, at.lower), hn::GatherIndex(d, from + 1, at.lower),
                       at.fy);
  };
  return interpolate(interpolate(along_y(0), along_y(1), at.fz),
                     interpolate(along_y(leaf.nz), along_y(leaf.nz + 1), at.fz), at.fx);
}

HWY_INLINE Vec softplus(Vec a, float beta) {
  const Tag d;
  const Vec t = exp2_of_negative(hn::Mul(hn::Set(d, -1.44269504f * beta), hn::Abs(a)));
  return hn::MulAdd(log1p_of_unit(t), hn::Set(d, 1.0f / beta), hn::Max(a, hn::Zero(d)));
}

double integrate_piece(const LeafVertices& leaf, Activation activation, const float* values,
                       const RayPiece& piece, float* densities) {
  const Tag d;
  Vec sum = hn::Zero(d);
  for (int i = 0; i < piece.num_samples; i += kVecLanes) {
    Vec f = sample(leaf, values, taps(leaf, piece, i));
    if (activation.beta > 0) f = softplus(f, activation.beta);
    hn::StoreU(f, d, densities + i);
    const auto counts = hn::FirstN(d, static_cast<std::size_t>(piece.num_samples - i));
    sum = hn::Add(sum, hn::IfThenElseZero(counts, f));
  }
  alignas(64) float parts[kLanes] = {};
  hn::Store(sum, d, parts);
  double total = 0.0;
  for (const float part : parts) total += static_cast<double>(part);
  return total * static_cast<double>(piece.segment_length);
}

// Adds the adjoint of sample(). The scatter is scalar, because two samples may share a vertex:
// eight additions a sample, most of them to cache lines that the sample before has touched.
HWY_INLINE void scatter(const LeafVertices& leaf, const Taps& at, Vec g, int count,
                        float* grad_values) {
  const Tag d;
  alignas(64) std::int32_t lower[kVecLanes];
  alignas(64) float corner[8][kVecLanes];
  hn::Store(at.lower, IntTag(), lower);
  const Vec g1 = hn::Mul(g, at.fx), g0 = hn::Sub(g, g1);
  const auto store = [&](Vec w, float(*out)[kVecLanes]) {
    const Vec w1 = hn::Mul(w, at.fz), w0 = hn::Sub(w, w1);
    const Vec w01 = hn::Mul(w0, at.fy), w11 = hn::Mul(w1, at.fy);
    hn::Store(hn::Sub(w0, w01), d, out[0]);
    hn::Store(w01, d, out[1]);
    hn::Store(hn::Sub(w1, w11), d, out[2]);
    hn::Store(w11, d, out[3]);
  };
  store(g0, corner);
  store(g1, corner + 4);
  const std::ptrdiff_t next_z = leaf.ny, next_x = static_cast<std::ptrdiff_t>(leaf.nz) * leaf.ny;
  for (int l = 0; l < count; ++l) {
    float* out = grad_values + lower[l];
    out[0] += corner[0][l];
    out[1] += corner[1][l];
    out[next_z] += corner[2][l];
    out[next_z + 1] += corner[3][l];
    out += next_x;
    out[0] += corner[4][l];
    out[1] += corner[5][l];
    out[next_z] += corner[6][l];
    out[next_z + 1] += corner[7][l];
  }
}

double spread_piece(const LeafVertices& leaf, Activation activation, const RayPiece& piece,
                    const float* densities, float g, float* grad_values) {
  const Tag d;
  const Vec weight = hn::Set(d, g * piece.segment_length);
  Vec sum = hn::Zero(d);
  for (int i = 0; i < piece.num_samples; i += kVecLanes) {
    Vec grad = weight;
    if (activation.beta > 0) {
      const Vec f = hn::LoadU(d, densities + i);
      const Vec rest = exp2_of_negative(hn::Mul(hn::Set(d, -1.44269504f * activation.beta), f));
      grad = hn::Sub(grad, hn::Mul(grad, rest));
    }
    const int count = piece.num_samples - i < kVecLanes ? piece.num_samples - i : kVecLanes;
    grad = hn::IfThenElseZero(hn::FirstN(d, static_cast<std::size_t>(count)), grad);
    sum = hn::Add(sum, grad);
    scatter(leaf, taps(leaf, piece, i), grad, count, grad_values);
  }
  alignas(64) float parts[kLanes] = {};
  hn::Store(sum, d, parts);
  double total = 0.0;
  for (const float part : parts) total += static_cast<double>(part);
  return total;
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(integrate_piece);
HWY_EXPORT(spread_piece);
double integrate_piece(const LeafVertices& leaf, Activation activation, const float* values,
                       const RayPiece& piece, float* densities) {
  return HWY_DYNAMIC_DISPATCH(integrate_piece)(leaf, activation, values, piece, densities);
}
double spread_piece(const LeafVertices& leaf, Activation activation, const RayPiece& piece,
                    const float* densities, float g, float* grad_values) {
  return HWY_DYNAMIC_DISPATCH(spread_piece)(leaf, activation, piece, densities, g, grad_values);
}
}  // namespace tomofield::kernels
#endif
