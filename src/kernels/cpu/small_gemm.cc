#include "kernels/small_gemm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/small_gemm.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::ScalableTag<float>;
using Vec = hn::Vec<Tag>;

// A block of kRows rows by kVecs vectors of C lives in registers: with 6 × 2
// there are 12 accumulators, 2 vectors of B and one broadcast, all that SSE
// and AVX2 have, and 12 independent FMAs cover their latency on two ports.
template <int kRows, int kVecs, bool kPartial>
HWY_INLINE void block(const SmallGemm& g, std::ptrdiff_t row, std::ptrdiff_t col,
                      std::ptrdiff_t last) {
  const Tag d;
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  const auto mask = hn::FirstN(d, static_cast<size_t>(last));
  Vec acc[kRows][kVecs];
  for (int m = 0; m < kRows; ++m)
    for (int v = 0; v < kVecs; ++v) acc[m][v] = hn::Zero(d);
  const float* a = g.a + row * g.a_row;
  const float* b = g.b + col;
  for (std::ptrdiff_t n = 0; n < g.depth; ++n) {
    Vec bv[kVecs];
    for (int v = 0; v < kVecs; ++v) {
      bv[v] = kPartial && v == kVecs - 1 ? hn::MaskedLoad(mask, d, b + v * lanes)
                                         : hn::LoadU(d, b + v * lanes);
    }
    for (int m = 0; m < kRows; ++m) {
      const Vec am = hn::Set(d, a[m * g.a_row]);
      for (int v = 0; v < kVecs; ++v) acc[m][v] = hn::MulAdd(am, bv[v], acc[m][v]);
    }
    a += g.a_col;
    b += g.b_row;
  }
  for (int m = 0; m < kRows; ++m) {
    float* c = g.c + (row + m) * g.c_row + col;
    for (int v = 0; v < kVecs; ++v) {
      float* p = c + v * lanes;
      if (kPartial && v == kVecs - 1) {
        hn::BlendedStore(hn::Add(hn::MaskedLoad(mask, d, p), acc[m][v]), mask, d, p);
      } else {
        hn::StoreU(hn::Add(hn::LoadU(d, p), acc[m][v]), d, p);
      }
    }
  }
}

template <int kVecs, bool kPartial>
HWY_INLINE void column_panel(const SmallGemm& g, std::ptrdiff_t col, std::ptrdiff_t last) {
  constexpr int kRows = kVecs == 1 ? 8 : 6;
  std::ptrdiff_t row = 0;
  for (; row + kRows <= g.rows; row += kRows) block<kRows, kVecs, kPartial>(g, row, col, last);
  for (; row + 2 <= g.rows; row += 2) block<2, kVecs, kPartial>(g, row, col, last);
  if (row < g.rows) block<1, kVecs, kPartial>(g, row, col, last);
}

void small_gemm(const SmallGemm& g) {
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(Tag()));
  std::ptrdiff_t col = 0;
  for (; col + 2 * lanes <= g.width; col += 2 * lanes) column_panel<2, false>(g, col, 0);
  for (; col + lanes <= g.width; col += lanes) column_panel<1, false>(g, col, 0);
  if (col < g.width) column_panel<1, true>(g, col, g.width - col);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(small_gemm);
void small_gemm(const SmallGemm& gemm) { HWY_DYNAMIC_DISPATCH(small_gemm)(gemm); }
}  // namespace tomofield::kernels
#endif
