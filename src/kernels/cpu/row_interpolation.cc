#include "kernels/row_interpolation.h"

#include <cstddef>

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/row_interpolation.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Calls body(tag, first column) for all columns, with full vectors as far as they fit and narrower
// ones for the rest.
template <class Body>
HWY_INLINE void for_each_vector(int width, const Body& body) {
  int c = 0;
  const auto with = [&](auto d) HWY_ATTR {
    const int lanes = static_cast<int>(hn::Lanes(d));
    for (; c + lanes <= width; c += lanes) body(d, c);
  };
  with(hn::CappedTag<float, 8>());
  with(hn::CappedTag<float, 4>());
  with(hn::CappedTag<float, 1>());
}

// Interpolating and spreading are bound by memory traffic. A lane takes two loads, two operations
// and a store a vector in L1. But each row serves only one product and streams from L2, or from L3
// if the factors of a slab's leaves do not fit in L2. L3 delivered 14 GB/s, so that
// reading the rows took a third as long as the products that they serve.
template <class D>
HWY_INLINE hn::Vec<D> interpolated(D d, const LaneTaps& taps, int lane, int width,
                                   const float* column) {
  const float* const lower = column + static_cast<std::ptrdiff_t>(taps.lower[lane]) * width;
  const auto low = hn::LoadU(d, lower);
  return hn::MulAdd(hn::Set(d, taps.fraction[lane]), hn::Sub(hn::LoadU(d, lower + width), low),
                    low);
}

void interpolate_rows(const LaneTaps& taps, int width, const float* matrix, float* out) {
  for_each_vector(width, [&](auto d, int c) HWY_ATTR {
    for (int l = 0; l < kLanes; ++l)
      hn::StoreU(interpolated(d, taps, l, width, matrix + c), d, out + l * width + c);
  });
}

#if HWY_TARGET != HWY_SCALAR
// Calls body(vector of four, first lane) for each block of four lanes.
template <class D, class Body>
HWY_INLINE void for_each_block(D, hn::Vec<D> v, int first, const Body& body) {
  if constexpr (hn::MaxLanes(D()) <= 4) {
    body(v, first);
  } else {
    const hn::Half<D> half;
    for_each_block(half, hn::LowerHalf(half, v), first, body);
    for_each_block(half, hn::UpperHalf(half, v), first + static_cast<int>(hn::Lanes(half)), body);
  }
}

// Transposes four rows, `from_row` floats apart, for as many columns as a vector has lanes. Calls
// body(a column's four numbers, column) for each column. The bound is eight shuffles for four
// vectors, one a cycle, and a store or an addition to memory for every four numbers.
template <class D, class Body>
HWY_INLINE void transpose_four_rows(D d, const float* from, std::ptrdiff_t from_row,
                                    const Body& body) {
  const auto row0 = hn::LoadU(d, from), row1 = hn::LoadU(d, from + from_row);
  const auto row2 = hn::LoadU(d, from + 2 * from_row), row3 = hn::LoadU(d, from + 3 * from_row);
  const auto low02 = hn::InterleaveLower(d, row0, row2), low13 = hn::InterleaveLower(d, row1, row3);
  const auto up02 = hn::InterleaveUpper(d, row0, row2), up13 = hn::InterleaveUpper(d, row1, row3);
  for_each_block(d, hn::InterleaveLower(d, low02, low13), 0, body);
  for_each_block(d, hn::InterleaveUpper(d, low02, low13), 1, body);
  for_each_block(d, hn::InterleaveLower(d, up02, up13), 2, body);
  for_each_block(d, hn::InterleaveUpper(d, up02, up13), 3, body);
}
#endif

void transpose_lanes(int width, const float* lanes, float* columns) {
  int c = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::FixedTag<float, 4> four;
  const auto with = [&](auto d) HWY_ATTR {
    const int count = static_cast<int>(hn::Lanes(d));
    for (; c + count <= width; c += count) {
      for (int l = 0; l < kLanes; l += 4) {
        transpose_four_rows(d, lanes + l * width + c, width, [&](auto v, int i) HWY_ATTR {
          hn::StoreU(v, four, columns + (c + i) * kLanes + l);
        });
      }
    }
  };
  with(hn::CappedTag<float, 16>());
  with(hn::CappedTag<float, 8>());
  with(four);
#endif
  for (; c < width; ++c)
    for (int l = 0; l < kLanes; ++l) columns[c * kLanes + l] = lanes[l * width + c];
}

void add_transposed(int width, const float* columns, float* lanes) {
  int c = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::FixedTag<float, 4> four;
  const hn::CappedTag<float, kLanes> d;
  for (; c + 4 <= width; c += 4) {
    for (int l = 0; l < kLanes; l += static_cast<int>(hn::Lanes(d))) {
      transpose_four_rows(d, columns + c * kLanes + l, kLanes, [&](auto v, int i) HWY_ATTR {
        float* const to = lanes + (l + i) * width + c;
        hn::StoreU(hn::Add(hn::LoadU(four, to), v), four, to);
      });
    }
  }
#endif
  for (; c < width; ++c)
    for (int l = 0; l < kLanes; ++l) lanes[l * width + c] += columns[c * kLanes + l];
}

// Sums the contributions of neighbouring lanes to a row in registers.
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix) {
  for_each_vector(width, [&](auto d, int c) HWY_ATTR {
    const auto add_to_row = [&](int row, auto sum) HWY_ATTR {
      float* const to = grad_matrix + static_cast<std::ptrdiff_t>(row) * width + c;
      hn::StoreU(hn::Add(hn::LoadU(d, to), sum), d, to);
    };
    auto low = hn::Zero(d), high = hn::Zero(d);  // sums for rows `at` and at + 1
    int at = taps.lower[0];
    for (int l = 0; l < kLanes; ++l) {
      if (taps.lower[l] != at) {
        add_to_row(at, low);
        if (taps.lower[l] == at + 1) {
          low = high;
        } else {
          add_to_row(at + 1, high);
          low = hn::Zero(d);
        }
        high = hn::Zero(d);
        at = taps.lower[l];
      }
      const auto g = hn::LoadU(d, grad + l * width + c);
      const auto upper = hn::Mul(g, hn::Set(d, taps.fraction[l]));
      low = hn::Add(low, hn::Sub(g, upper));
      high = hn::Add(high, upper);
    }
    add_to_row(at, low);
    add_to_row(at + 1, high);
  });
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(interpolate_rows);
HWY_EXPORT(transpose_lanes);
HWY_EXPORT(add_transposed);
HWY_EXPORT(spread_rows);

void interpolate_rows(const LaneTaps& taps, int width, const float* matrix, float* out) {
  HWY_DYNAMIC_DISPATCH(interpolate_rows)(taps, width, matrix, out);
}
void transpose_lanes(int width, const float* lanes, float* columns) {
  HWY_DYNAMIC_DISPATCH(transpose_lanes)(width, lanes, columns);
}
void add_transposed(int width, const float* columns, float* lanes) {
  HWY_DYNAMIC_DISPATCH(add_transposed)(width, columns, lanes);
}
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix) {
  HWY_DYNAMIC_DISPATCH(spread_rows)(taps, width, grad, grad_matrix);
}
}  // namespace tomofield::kernels
#endif
