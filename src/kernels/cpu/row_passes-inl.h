// Matrix products C += A B of small depth for AVX-512, which has 32 registers. Up to 24 rows of B
// stay in registers, and four rows of A and C at a time pass through them. foreach_target includes
// this file once per target; on other targets multiplied_by_passes() declines every product.
#if defined(TOMOFIELD_KERNELS_CPU_ROW_PASSES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TOMOFIELD_KERNELS_CPU_ROW_PASSES_INL_H_
#undef TOMOFIELD_KERNELS_CPU_ROW_PASSES_INL_H_
#else
#define TOMOFIELD_KERNELS_CPU_ROW_PASSES_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "kernels/small_gemm.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET <= HWY_AVX3
// Adds the product of kRows rows of A, kDepth columns wide, and kDepth rows of B, one vector wide,
// to C. a[m] points into row m of A. Each row keeps two sums, one for either half of the depth, so
// that with four rows there are enough independent FMAs to hide their latency. The bound is kDepth
// FMAs a row at two a cycle. Each FMA includes its broadcast of a number of A; as every row has its
// own pointer, this is a single micro-operation.
template <int kDepth, int kRows, class D>
HWY_INLINE void pass_rows(D d, const hn::Vec<D> (&b)[kDepth], const float* const (&a)[kRows],
                          float* c, std::ptrdiff_t c_row) {
  constexpr int kHalf = kDepth / 2;
  hn::Vec<D> low[kRows], high[kRows];
  HWY_UNROLL(4)
  for (int m = 0; m < kRows; ++m) {
    low[m] = hn::LoadU(d, c + m * c_row);
    high[m] = hn::Mul(hn::Set(d, a[m][kHalf]), b[kHalf]);
  }
  HWY_UNROLL(12)
  for (int n = 0; n < kHalf; ++n) {
    HWY_UNROLL(4)
    for (int m = 0; m < kRows; ++m) {
      low[m] = hn::MulAdd(hn::Set(d, a[m][n]), b[n], low[m]);
      if (n > 0) high[m] = hn::MulAdd(hn::Set(d, a[m][kHalf + n]), b[kHalf + n], high[m]);
    }
  }
  HWY_UNROLL(4)
  for (int m = 0; m < kRows; ++m) hn::StoreU(hn::Add(low[m], high[m]), d, c + m * c_row);
}

// Calls pass_four(rows of A from column `first`, row of C) for every four rows, and pass_one for
// the rows that remain.
template <class PassFour, class PassOne>
HWY_INLINE void for_each_four_rows(const SmallGemm& g, std::ptrdiff_t first,
                                   const PassFour& pass_four, const PassOne& pass_one) {
  const float* a[4];
  for (int m = 0; m < 4; ++m) a[m] = g.a + first + m * g.a_row;
  float* c = g.c;
  std::ptrdiff_t left = g.rows;
  for (; left >= 4; left -= 4, c += 4 * g.c_row) {
    pass_four(a, c);
    for (int m = 0; m < 4; ++m) a[m] += 4 * g.a_row;
  }
  for (int m = 0; m < left; ++m, c += g.c_row) {
    const float* const one[1] = {a[m]};
    pass_one(one, c);
  }
}

// Adds the product of kDepth columns of A, from `first`, and one vector of columns of B, from
// `col`, to all rows of C.
template <int kDepth>
HWY_INLINE void pass_all_rows(const SmallGemm& g, std::ptrdiff_t first, std::ptrdiff_t col) {
  const hn::FixedTag<float, 16> d;
  hn::Vec<decltype(d)> b[kDepth];
  HWY_UNROLL(24)
  for (int n = 0; n < kDepth; ++n) b[n] = hn::LoadU(d, g.b + (first + n) * g.b_row + col);
  for_each_four_rows(
      g, first,
      [&](const auto& a, float* c) HWY_ATTR { pass_rows<kDepth, 4>(d, b, a, c + col, g.c_row); },
      [&](const auto& a, float* c) HWY_ATTR { pass_rows<kDepth, 1>(d, b, a, c + col, g.c_row); });
}

// Does the same as pass_rows for columns that fill half a vector. Two rows of B are interleaved in
// one vector, and so are two partial sums, from the even and from the odd columns of A. This halves
// the number of FMAs; each broadcasts a pair of numbers of A.
template <int kDepth, int kRows, class D>
HWY_INLINE void pass_rows_of_half(D d, const hn::Vec<D> (&pairs)[kDepth / 2],
                                  const float* const (&a)[kRows], float* c, std::ptrdiff_t c_row) {
  const hn::Half<D> half;
  const hn::RepartitionToWide<D> wide;
  hn::Vec<D> sums[kRows];
  HWY_UNROLL(4)
  for (int m = 0; m < kRows; ++m) sums[m] = hn::Zero(d);
  HWY_UNROLL(12)
  for (int n = 0; n < kDepth / 2; ++n) {
    HWY_UNROLL(4)
    for (int m = 0; m < kRows; ++m) {
      double pair;
      hwy::CopyBytes<sizeof(pair)>(a[m] + 2 * n, &pair);
      sums[m] = hn::MulAdd(hn::BitCast(d, hn::Set(wide, pair)), pairs[n], sums[m]);
    }
  }
  const auto add = [&](hn::Vec<hn::Half<D>> sum, float* to)
                       HWY_ATTR { hn::StoreU(hn::Add(hn::LoadU(half, to), sum), half, to); };
  HWY_UNROLL(2)
  for (int m = 0; m < kRows; m += 2) {
    const auto next = sums[m + 1 < kRows ? m + 1 : m];
    const auto both = hn::Add(hn::ConcatEven(d, next, sums[m]), hn::ConcatOdd(d, next, sums[m]));
    add(hn::LowerHalf(half, both), c + m * c_row);
    if (m + 1 < kRows) add(hn::UpperHalf(half, both), c + (m + 1) * c_row);
  }
}

// Does the same as pass_all_rows for columns that fill half a vector.
template <int kDepth>
HWY_INLINE void pass_all_rows_of_half(const SmallGemm& g, std::ptrdiff_t first,
                                      std::ptrdiff_t col) {
  const hn::FixedTag<float, 16> d;
  const hn::FixedTag<float, 8> half;
  HWY_ALIGN static constexpr std::int32_t kInterleaved[16] = {0, 8,  1, 9,  2, 10, 3, 11,
                                                              4, 12, 5, 13, 6, 14, 7, 15};
  const auto interleaved = hn::SetTableIndices(d, kInterleaved);
  hn::Vec<decltype(d)> pairs[kDepth / 2];
  HWY_UNROLL(12)
  for (int n = 0; n < kDepth / 2; ++n) {
    const float* const b = g.b + (first + 2 * n) * g.b_row + col;
    const auto both = hn::Combine(d, hn::LoadU(half, b + g.b_row), hn::LoadU(half, b));
    pairs[n] = hn::TableLookupLanes(both, interleaved);
  }
  for_each_four_rows(
      g, first,
      [&](const auto& a, float* c)
          HWY_ATTR { pass_rows_of_half<kDepth, 4>(d, pairs, a, c + col, g.c_row); },
      [&](const auto& a, float* c)
          HWY_ATTR { pass_rows_of_half<kDepth, 1>(d, pairs, a, c + col, g.c_row); });
}

// Adds the product of kDepth columns of A, from `first`, and all columns of B to C.
template <int kDepth>
HWY_INLINE void pass_all_columns(const SmallGemm& g, std::ptrdiff_t first) {
  std::ptrdiff_t col = 0;
  for (; col + 16 <= g.width; col += 16) pass_all_rows<kDepth>(g, first, col);
  if (col < g.width) pass_all_rows_of_half<kDepth>(g, first, col);
}

// Computes the product and returns true if its shape suits passes; otherwise returns false and
// leaves C as it is.
HWY_INLINE bool multiplied_by_passes(const SmallGemm& g) {
  if (g.a_col != 1 || g.depth > 48 || g.depth % 8 != 0 || g.width % 8 != 0) return false;
  std::ptrdiff_t first = 0;
  for (; g.depth - first >= 24; first += 24) pass_all_columns<24>(g, first);
  if (g.depth - first == 16) pass_all_columns<16>(g, first);
  if (g.depth - first == 8) pass_all_columns<8>(g, first);
  return true;
}
#else
HWY_INLINE bool multiplied_by_passes(const SmallGemm&) { return false; }
#endif

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
