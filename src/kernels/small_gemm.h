#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// The product C += A B for small matrices with any strides. All contractions of a factorised
/// tensor consist of this operation:
///
///   C[m, w] += Σ_n A[m, n] B[n, w]     0 <= m < rows, 0 <= n < depth, 0 <= w < width
///
/// with A[m, n] = a[m a_row + n a_col], B[n, w] = b[n b_row + w] and C[m, w] = c[m c_row + w].
/// Strides count floats. No alignment is needed. C must not overlap A or B.
///
/// Work: rows · depth · width FMAs. C is read and written once, and B is read once for every few
/// rows of C, so width and depth should keep B within L1 or L2.
struct SmallGemm {
  std::ptrdiff_t rows = 0, depth = 0, width = 0;
  const float* a = nullptr;
  std::ptrdiff_t a_row = 0, a_col = 0;
  const float* b = nullptr;
  std::ptrdiff_t b_row = 0;
  float* c = nullptr;
  std::ptrdiff_t c_row = 0;
};

/// Computes C += A B.
void small_gemm(const SmallGemm& gemm);

}  // namespace tomofield::kernels
