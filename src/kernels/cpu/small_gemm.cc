#include "kernels/small_gemm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/small_gemm.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A block of kRows rows by kVecs vectors of C lives in registers: with 6 × 2
// there are 12 accumulators, 2 vectors of B and one broadcast, all that SSE
// and AVX2 have, and 12 independent FMAs cover their latency on two ports.
template <int kRows, int kVecs, class D>
HWY_INLINE void block(D d, const SmallGemm& g, std::ptrdiff_t row, std::ptrdiff_t col) {
  using Vec = hn::Vec<D>;
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  const float* a = g.a + row * g.a_row;
  const float* b = g.b + col;
  float* const c = g.c + row * g.c_row + col;
  Vec acc[kRows][kVecs];
  for (int m = 0; m < kRows; ++m)
    for (int v = 0; v < kVecs; ++v) acc[m][v] = hn::LoadU(d, c + m * g.c_row + v * lanes);
  for (std::ptrdiff_t n = 0; n < g.depth; ++n) {
    Vec bv[kVecs];
    for (int v = 0; v < kVecs; ++v) bv[v] = hn::LoadU(d, b + v * lanes);
    for (int m = 0; m < kRows; ++m) {
      const Vec am = hn::Set(d, a[m * g.a_row]);
      for (int v = 0; v < kVecs; ++v) acc[m][v] = hn::MulAdd(am, bv[v], acc[m][v]);
    }
    a += g.a_col;
    b += g.b_row;
  }
  for (int m = 0; m < kRows; ++m)
    for (int v = 0; v < kVecs; ++v) hn::StoreU(acc[m][v], d, c + m * g.c_row + v * lanes);
}

// The last rows of a panel, fewer than kRows.
template <int kRows, int kVecs, class D>
HWY_INLINE void rest(D d, const SmallGemm& g, std::ptrdiff_t row, std::ptrdiff_t col) {
  if constexpr (kRows > 1) {
    if (g.rows - row == kRows - 1) {
      block<kRows - 1, kVecs>(d, g, row, col);
    } else {
      rest<kRows - 1, kVecs>(d, g, row, col);
    }
  }
}

// Columns from `col` on, as many panels of kVecs vectors as fit; returns the
// first column that is left.
template <int kVecs, class D>
HWY_INLINE std::ptrdiff_t panels(D d, const SmallGemm& g, std::ptrdiff_t col) {
  constexpr int kRows = kVecs == 1 ? 8 : 6;
  const std::ptrdiff_t width = kVecs * static_cast<std::ptrdiff_t>(hn::Lanes(d));
  for (; col + width <= g.width; col += width) {
    std::ptrdiff_t row = 0;
    for (; row + kRows <= g.rows; row += kRows) block<kRows, kVecs>(d, g, row, col);
    rest<kRows, kVecs>(d, g, row, col);
  }
  return col;
}

// Narrower vectors take what is left over at the right: masked loads and
// stores may touch memory beside the row on targets without true masks.
void small_gemm(const SmallGemm& g) {
  const hn::ScalableTag<float> full;
  std::ptrdiff_t col = panels<2>(full, g, 0);
  col = panels<1>(full, g, col);
  col = panels<1>(hn::CappedTag<float, 8>(), g, col);
  col = panels<1>(hn::CappedTag<float, 4>(), g, col);
  panels<1>(hn::CappedTag<float, 1>(), g, col);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(small_gemm);
void small_gemm(const SmallGemm& gemm) { HWY_DYNAMIC_DISPATCH(small_gemm)(gemm); }
}  // namespace tomofield::kernels
#endif
