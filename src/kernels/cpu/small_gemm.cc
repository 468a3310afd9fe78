#include "kernels/small_gemm.h"

#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/small_gemm.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Columns of C that are worked on together: kFull vectors and, with kHalf, half a vector beside
// them (24 ranks are one and a half vectors of AVX-512, and one pass over A and C in place of two).
//
// A block of kMostRows rows of a panel lives in registers. Bound: kRows · kVecs FMAs, two a cycle,
// against kRows broadcasts of A and kVecs loads of B, two a cycle as well; a row of one vector has
// its broadcast inside the FMA. Eight FMAs at least cover their latency.
//
// Where the rows of A are neighbours (a transposed matrix), they are addressed without the stride,
// and with AVX-512 an FMA that has its broadcast inside is one instruction of one part: 24 ranks
// times 16 lanes are then 25 instructions a step of the depth.
template <int kFullVecs, bool kHalfVec, bool kAreNeighbours = false>
struct Panel {
  static constexpr int kFull = kFullVecs;
  static constexpr bool kHalf = kHalfVec;
  static constexpr bool kNeighbours = kAreNeighbours;
  static constexpr int kVecs = kFull + (kHalf ? 1 : 0);
#if HWY_TARGET <= HWY_AVX3
  static constexpr int kMostRows = kNeighbours ? 24 : kVecs == 3 ? 8 : 12;  // of 32 registers
#else
  static constexpr int kMostRows = kVecs == 1 ? 8 : 12 / kVecs;  // of 16
#endif
};

// Rows of A, four by four: a pointer and the stride address all four.
template <int kRows, bool kNeighbours>
class RowsOfA {
 public:
  RowsOfA(const float* a, std::ptrdiff_t stride) : stride_(stride) {
    for (int g = 0; g < kGroups; ++g) group_[g] = a + 4 * g * stride;
  }
  HWY_INLINE float operator[](int m) const { return group_[m / 4][(m % 4) * stride_]; }
  HWY_INLINE void advance(std::ptrdiff_t step) {
    for (int g = 0; g < kGroups; ++g) group_[g] += step;
  }

 private:
  static constexpr int kGroups = (kRows + 3) / 4;
  const float* group_[kGroups];
  std::ptrdiff_t stride_;
};

template <int kRows>
class RowsOfA<kRows, true> {
 public:
  RowsOfA(const float* a, std::ptrdiff_t) : first_(a) {}
  HWY_INLINE float operator[](int m) const { return first_[m]; }
  HWY_INLINE void advance(std::ptrdiff_t step) { first_ += step; }

 private:
  const float* first_;
};

template <class P, int kRows, class D>
HWY_INLINE void block(D d, const SmallGemm& g, std::ptrdiff_t row, std::ptrdiff_t col) {
  const hn::Half<D> half;
  using Vec = hn::Vec<D>;
  using HalfVec = hn::Vec<hn::Half<D>>;
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  RowsOfA<kRows, P::kNeighbours> a(g.a + row * g.a_row, g.a_row);
  const float* b = g.b + col;
  float* const c = g.c + row * g.c_row + col;
  Vec acc[kRows][P::kFull];
  HalfVec side[kRows];
  HWY_UNROLL(24)
  for (int m = 0; m < kRows; ++m) {
    for (int v = 0; v < P::kFull; ++v) acc[m][v] = hn::LoadU(d, c + m * g.c_row + v * lanes);
    if constexpr (P::kHalf) side[m] = hn::LoadU(half, c + m * g.c_row + P::kFull * lanes);
  }
  for (std::ptrdiff_t n = 0; n < g.depth; ++n) {
    Vec bv[P::kFull];
    HalfVec b_side;
    for (int v = 0; v < P::kFull; ++v) bv[v] = hn::LoadU(d, b + v * lanes);
    if constexpr (P::kHalf) b_side = hn::LoadU(half, b + P::kFull * lanes);
    HWY_UNROLL(24)
    for (int m = 0; m < kRows; ++m) {
      const Vec am = hn::Set(d, a[m]);
      for (int v = 0; v < P::kFull; ++v) acc[m][v] = hn::MulAdd(am, bv[v], acc[m][v]);
      if constexpr (P::kHalf) side[m] = hn::MulAdd(hn::LowerHalf(half, am), b_side, side[m]);
    }
    a.advance(g.a_col);
    b += g.b_row;
  }
  HWY_UNROLL(24)
  for (int m = 0; m < kRows; ++m) {
    for (int v = 0; v < P::kFull; ++v) hn::StoreU(acc[m][v], d, c + m * g.c_row + v * lanes);
    if constexpr (P::kHalf) hn::StoreU(side[m], half, c + m * g.c_row + P::kFull * lanes);
  }
}

template <class P, int kRows, class D>
HWY_INLINE void block_of_rows(std::ptrdiff_t rows, D d, const SmallGemm& g, std::ptrdiff_t row,
                              std::ptrdiff_t col) {
  if constexpr (kRows > 0) {
    if (rows == kRows) {
      block<P, kRows>(d, g, row, col);
    } else {
      block_of_rows<P, kRows - 1>(rows, d, g, row, col);
    }
  }
}

// All rows of a panel in as few blocks as there can be, which differ by a row at most: a short
// one would wait for its few FMAs. Returns the column after the panel.
template <class P, class D>
HWY_INLINE std::ptrdiff_t panel(D d, const SmallGemm& g, std::ptrdiff_t col) {
  const std::ptrdiff_t blocks = (g.rows + P::kMostRows - 1) / P::kMostRows;
  const std::ptrdiff_t lower = blocks == 0 ? 0 : g.rows / blocks, higher = g.rows - lower * blocks;
  for (std::ptrdiff_t i = 0, row = 0; i < blocks; ++i) {
    const std::ptrdiff_t rows = lower + (i < higher ? 1 : 0);
    block_of_rows<P, P::kMostRows>(rows, d, g, row, col);
    row += rows;
  }
  const auto lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  return col + P::kFull * lanes + (P::kHalf ? lanes / 2 : 0);
}

#if HWY_TARGET <= HWY_AVX3
// Adds the product of kDepth columns of A, whose rows lie kRow floats apart, and as many rows of B,
// one vector wide, which stay in registers while the rows of C pass by. Of a row the two halves are
// summed apart, four rows together, which covers the latency of their FMAs. Bound: kDepth FMAs a
// row, two a cycle, each with its broadcast inside; the constant distance of rows makes it one
// instruction of one part.
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

// Calls pass(rows of A from `first`, row of C) for all rows, four by four.
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

// Half a vector of columns: pairs of rows of B lie interleaved in one vector, and so do the sums of
// what even and odd columns of A give.
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

template <int kDepth>
HWY_INLINE void pass_all_columns(const SmallGemm& g, std::ptrdiff_t first) {
  std::ptrdiff_t col = 0;
  for (; col + 16 <= g.width; col += 16) pass_all_rows<kDepth>(g, first, col);
  if (col < g.width) pass_all_rows_of_half<kDepth>(g, first, col);
}

// Products of little depth and whole vectors or halves of them.
HWY_INLINE bool rows_pass(const SmallGemm& g) {
  if (g.a_col != 1 || g.depth > 48 || g.depth % 8 != 0 || g.width % 8 != 0) return false;
  std::ptrdiff_t first = 0;
  for (; g.depth - first >= 24; first += 24) pass_all_columns<24>(g, first);
  if (g.depth - first == 16) pass_all_columns<16>(g, first);
  if (g.depth - first == 8) pass_all_columns<8>(g, first);
  return true;
}
#else
HWY_INLINE bool rows_pass(const SmallGemm&) { return false; }
#endif

template <class D>
HWY_INLINE std::ptrdiff_t single_vectors(D d, const SmallGemm& g, std::ptrdiff_t col) {
  while (col + static_cast<std::ptrdiff_t>(hn::Lanes(d)) <= g.width)
    col = panel<Panel<1, false>>(d, g, col);
  return col;
}

void small_gemm(const SmallGemm& g) {
  if (rows_pass(g)) return;
  const hn::ScalableTag<float> d;
  std::ptrdiff_t col = 0;
  if (g.a_row == 1 && g.width == static_cast<std::ptrdiff_t>(hn::Lanes(d)))
    col = panel<Panel<1, false, true>>(d, g, col);
  const auto half_vectors_left = [&] {
    return 2 * (g.width - col) / static_cast<std::ptrdiff_t>(hn::Lanes(d));
  };
  while (half_vectors_left() >= 8 || half_vectors_left() / 2 == 2)
    col = panel<Panel<2, false>>(d, g, col);
  if (half_vectors_left() >= 6) col = panel<Panel<3, false>>(d, g, col);
  if (half_vectors_left() == 3) col = panel<Panel<1, true>>(d, g, col);
  // Narrower vectors take what is left over at the right: masked loads and
  // stores may touch memory beside the row on targets without true masks.
  col = single_vectors(d, g, col);
  col = single_vectors(hn::CappedTag<float, 8>(), g, col);
  col = single_vectors(hn::CappedTag<float, 4>(), g, col);
  single_vectors(hn::CappedTag<float, 1>(), g, col);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(small_gemm);
void small_gemm(const SmallGemm& gemm) { HWY_DYNAMIC_DISPATCH(small_gemm)(gemm); }
}  // namespace tomofield::kernels
#endif
