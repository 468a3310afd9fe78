#include "kernels/small_gemm.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/small_gemm.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

#include "kernels/cpu/row_passes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Vectors of columns of C that are computed together.
//
// A block of kMaxRows rows of a panel stays in registers. The bound is kRows · kVecs FMAs, two a
// cycle, against kRows broadcasts of A and kVecs loads of B, also two a cycle. With one vector a
// row, the broadcast is part of the FMA. At least eight FMAs are needed to hide their latency.
//
// If the rows of A are adjacent in memory (a transposed matrix), they are addressed without the
// stride. With AVX-512, an FMA that includes its broadcast is then a single micro-operation, so a
// step of the depth takes 25 of them for 24 ranks times 16 lanes.
template <int kVectors, bool kAreNeighbours = false>
struct Panel {
  static constexpr int kVecs = kVectors;
  static constexpr bool kNeighbours = kAreNeighbours;
#if HWY_TARGET <= HWY_AVX3
  static constexpr int kMaxRows = kNeighbours ? 24 : kVecs == 3 ? 8 : 12;  // of 32 registers
#else
  static constexpr int kMaxRows = kVecs == 1 ? 8 : 12 / kVecs;  // of 16 registers
#endif
};

// Addresses rows of A. One pointer and the stride address four rows.
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
  using Vec = hn::Vec<D>;
  const std::ptrdiff_t lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  RowsOfA<kRows, P::kNeighbours> a(g.a + row * g.a_row, g.a_row);
  const float* b = g.b + col;
  float* const c = g.c + row * g.c_row + col;
  Vec acc[kRows][P::kVecs];
  HWY_UNROLL(24)
  for (int m = 0; m < kRows; ++m)
    for (int v = 0; v < P::kVecs; ++v) acc[m][v] = hn::LoadU(d, c + m * g.c_row + v * lanes);
  for (std::ptrdiff_t n = 0; n < g.depth; ++n) {
    Vec bv[P::kVecs];
    for (int v = 0; v < P::kVecs; ++v) bv[v] = hn::LoadU(d, b + v * lanes);
    HWY_UNROLL(24)
    for (int m = 0; m < kRows; ++m) {
      const Vec am = hn::Set(d, a[m]);
      for (int v = 0; v < P::kVecs; ++v) acc[m][v] = hn::MulAdd(am, bv[v], acc[m][v]);
    }
    a.advance(g.a_col);
    b += g.b_row;
  }
  HWY_UNROLL(24)
  for (int m = 0; m < kRows; ++m)
    for (int v = 0; v < P::kVecs; ++v) hn::StoreU(acc[m][v], d, c + m * g.c_row + v * lanes);
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

// Computes all rows of a panel in as few blocks as possible. Their sizes differ by one row at most,
// because a short block would wait for its few FMAs. Returns the column after the panel.
template <class P, class D>
HWY_INLINE std::ptrdiff_t panel(D d, const SmallGemm& g, std::ptrdiff_t col) {
  const std::ptrdiff_t blocks = (g.rows + P::kMaxRows - 1) / P::kMaxRows;
  const std::ptrdiff_t lower = blocks == 0 ? 0 : g.rows / blocks, higher = g.rows - lower * blocks;
  for (std::ptrdiff_t i = 0, row = 0; i < blocks; ++i) {
    const std::ptrdiff_t rows = lower + (i < higher ? 1 : 0);
    block_of_rows<P, P::kMaxRows>(rows, d, g, row, col);
    row += rows;
  }
  return col + P::kVecs * static_cast<std::ptrdiff_t>(hn::Lanes(d));
}

template <class D>
HWY_INLINE std::ptrdiff_t single_vectors(D d, const SmallGemm& g, std::ptrdiff_t col) {
  while (col + static_cast<std::ptrdiff_t>(hn::Lanes(d)) <= g.width)
    col = panel<Panel<1>>(d, g, col);
  return col;
}

// Computes the product of rows with a single vector B, both without gaps, and returns true if its
// shape suits; otherwise returns false and leaves C as it is.
HWY_INLINE bool multiplied_by_dot_products(const SmallGemm& g) {
  const hn::CappedTag<float, 8> d;  // factors have ranks that are multiples of 8
  const auto lanes = static_cast<std::ptrdiff_t>(hn::Lanes(d));
  if (g.width != 1 || g.a_col != 1 || g.b_row != 1 || g.depth % lanes != 0) return false;
  for (std::ptrdiff_t row = 0; row < g.rows; ++row) {
    const float* const a = g.a + row * g.a_row;
    auto sum = hn::Zero(d);
    for (std::ptrdiff_t n = 0; n < g.depth; n += lanes)
      sum = hn::MulAdd(hn::LoadU(d, a + n), hn::LoadU(d, g.b + n), sum);
    g.c[row * g.c_row] += hn::GetLane(hn::SumOfLanes(d, sum));
  }
  return true;
}

void small_gemm(const SmallGemm& g) {
  if (multiplied_by_passes(g) || multiplied_by_dot_products(g)) return;
  const hn::ScalableTag<float> d;
  std::ptrdiff_t col = 0;
  const auto vectors_left = [&] {
    return (g.width - col) / static_cast<std::ptrdiff_t>(hn::Lanes(d));
  };
  if (g.a_row == 1 && vectors_left() == 1) col = panel<Panel<1, true>>(d, g, col);
  while (vectors_left() >= 4 || vectors_left() == 2) col = panel<Panel<2>>(d, g, col);
  if (vectors_left() == 3) col = panel<Panel<3>>(d, g, col);
  // Narrower vectors handle the remaining columns at the right. Masked loads and stores may touch
  // memory beside the row on targets without true masks.
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
