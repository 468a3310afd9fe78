#include "kernels/point_products.h"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/point_products.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The offsets of one point's six rows of ranks, and their weights.
struct Corners {
  std::ptrdiff_t vector, matrix;          // offsets of the lower vertices
  std::ptrdiff_t next_a, next_b, next_c;  // steps to the upper ones
  float a, w00, w01, w10, w11;

  Corners(const PointProducts& p, int point) {
    const float b = p.b.fraction[point], c = p.c.fraction[point];
    next_a = next_c = p.rank;
    next_b = static_cast<std::ptrdiff_t>(p.nc) * p.rank;
    vector = static_cast<std::ptrdiff_t>(p.a.lower[point]) * p.rank;
    matrix = p.b.lower[point] * next_b + static_cast<std::ptrdiff_t>(p.c.lower[point]) * p.rank;
    a = p.a.fraction[point];
    w11 = b * c;
    w10 = b - w11;
    w01 = c - w11;
    w00 = 1.0f - b - w01;
  }
};

// The bound is latency. A point's six rows of ranks lie in six places of a leaf, two cache lines
// each for 24 ranks. They serve seven operations a vector forward and twice as many back.
template <class D>
HWY_INLINE hn::Vec<D> vector_at(D d, const Corners& at, const float* v) {
  const auto low = hn::LoadU(d, v);
  return hn::MulAdd(hn::Set(d, at.a), hn::Sub(hn::LoadU(d, v + at.next_a), low), low);
}

template <class D>
HWY_INLINE hn::Vec<D> matrix_at(D d, const Corners& at, const float* m) {
  auto sum = hn::Mul(hn::Set(d, at.w00), hn::LoadU(d, m));
  sum = hn::MulAdd(hn::Set(d, at.w01), hn::LoadU(d, m + at.next_c), sum);
  sum = hn::MulAdd(hn::Set(d, at.w10), hn::LoadU(d, m + at.next_b), sum);
  return hn::MulAdd(hn::Set(d, at.w11), hn::LoadU(d, m + at.next_b + at.next_c), sum);
}

template <class D>
HWY_INLINE void add_scaled(D d, float weight, hn::Vec<D> v, float* to) {
  hn::StoreU(hn::MulAdd(hn::Set(d, weight), v, hn::LoadU(d, to)), d, to);
}

// Calls body(tag, first rank) for all ranks, with full vectors as far as they fit and narrower ones
// for the rest.
template <class Body>
HWY_INLINE void for_each_vector(int rank, const Body& body) {
  int r = 0;
  const auto with = [&](auto d) HWY_ATTR {
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (; r + lanes <= rank; r += lanes) body(d, r);
  };
  with(hn::CappedTag<float, 16>());
  with(hn::CappedTag<float, 4>());
  with(hn::CappedTag<float, 1>());
}

void add_point_products(const PointProducts& p, const float* vector, const float* matrix,
                        float* values) {
  for (int n = 0; n < p.a.count; ++n) {
    const Corners at(p, n);
    float sum = 0.0f;
    for_each_vector(p.rank, [&](auto d, int r) HWY_ATTR {
      const auto product = hn::Mul(vector_at(d, at, vector + at.vector + r),
                                   matrix_at(d, at, matrix + at.matrix + r));
      sum += hn::GetLane(hn::SumOfLanes(d, product));
    });
    values[n] += sum;
  }
}

void add_point_products_gradient(const PointProducts& p, const float* vector, const float* matrix,
                                 const float* grad_values, float* grad_vector, float* grad_matrix) {
  for (int n = 0; n < p.a.count; ++n) {
    const Corners at(p, n);
    for_each_vector(p.rank, [&](auto d, int r) HWY_ATTR {
      const auto g = hn::Set(d, grad_values[n]);
      const auto grad_v = hn::Mul(g, matrix_at(d, at, matrix + at.matrix + r));
      const auto grad_m = hn::Mul(g, vector_at(d, at, vector + at.vector + r));
      float* const to_v = grad_vector + at.vector + r;
      float* const to_m = grad_matrix + at.matrix + r;
      add_scaled(d, 1.0f - at.a, grad_v, to_v);
      add_scaled(d, at.a, grad_v, to_v + at.next_a);
      add_scaled(d, at.w00, grad_m, to_m);
      add_scaled(d, at.w01, grad_m, to_m + at.next_c);
      add_scaled(d, at.w10, grad_m, to_m + at.next_b);
      add_scaled(d, at.w11, grad_m, to_m + at.next_b + at.next_c);
    });
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(add_point_products);
HWY_EXPORT(add_point_products_gradient);

void add_point_products(const PointProducts& points, const float* vector, const float* matrix,
                        float* values) {
  HWY_DYNAMIC_DISPATCH(add_point_products)(points, vector, matrix, values);
}
void add_point_products_gradient(const PointProducts& points, const float* vector,
                                 const float* matrix, const float* grad_values, float* grad_vector,
                                 float* grad_matrix) {
  HWY_DYNAMIC_DISPATCH(add_point_products_gradient)
  (points, vector, matrix, grad_values, grad_vector, grad_matrix);
}
}  // namespace tomofield::kernels
#endif
