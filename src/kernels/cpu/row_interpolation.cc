#include "kernels/row_interpolation.h"

#include <cstddef>

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/row_interpolation.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Calls body(tag, first column) for all columns: as many full vectors as fit, then narrower ones.
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

// Bound of all three: bytes. A lane is two loads, two operations and a store a vector in L1, but
// rows are used for one product each and stream from L2 or, where the factors of a slab's leaves do
// not fit there, from L3 (14 GB/s measured: as long as a third of the products that they serve).
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

// Four lanes at a time: their columns are interleaved, which makes four
// neighbouring lanes of each column.
void interpolate_rows_transposed(const LaneTaps& taps, int width, const float* matrix, float* out) {
  for_each_vector(width, [&](auto d, int c) HWY_ATTR {
    constexpr int kColumns = static_cast<int>(hn::MaxLanes(decltype(d)()));
    HWY_ALIGN float four[kColumns * 4];
    for (int l = 0; l < kLanes; l += 4) {
      hn::StoreInterleaved4(interpolated(d, taps, l, width, matrix + c),
                            interpolated(d, taps, l + 1, width, matrix + c),
                            interpolated(d, taps, l + 2, width, matrix + c),
                            interpolated(d, taps, l + 3, width, matrix + c), d, four);
      for (int i = 0; i < kColumns; ++i)
        for (int k = 0; k < 4; ++k) out[(c + i) * kLanes + l + k] = four[4 * i + k];
    }
  });
}

// What neighbouring lanes give a row is summed in registers.
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix) {
  for_each_vector(width, [&](auto d, int c) HWY_ATTR {
    const auto add_to_row = [&](int row, auto sum) HWY_ATTR {
      float* const to = grad_matrix + static_cast<std::ptrdiff_t>(row) * width + c;
      hn::StoreU(hn::Add(hn::LoadU(d, to), sum), d, to);
    };
    auto low = hn::Zero(d), high = hn::Zero(d);  // for rows `at` and at + 1
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
HWY_EXPORT(interpolate_rows_transposed);
HWY_EXPORT(spread_rows);

void interpolate_rows(const LaneTaps& taps, int width, const float* matrix, float* out) {
  HWY_DYNAMIC_DISPATCH(interpolate_rows)(taps, width, matrix, out);
}
void interpolate_rows_transposed(const LaneTaps& taps, int width, const float* matrix, float* out) {
  HWY_DYNAMIC_DISPATCH(interpolate_rows_transposed)(taps, width, matrix, out);
}
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix) {
  HWY_DYNAMIC_DISPATCH(spread_rows)(taps, width, grad, grad_matrix);
}
}  // namespace tomofield::kernels
#endif
