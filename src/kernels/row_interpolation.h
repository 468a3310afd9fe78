#pragma once

namespace tomofield::kernels {

/// The kLanes rows of a slab between the rows of a matrix: lane l interpolates
/// matrix rows lower[l] and lower[l] + 1, which both exist, with weight
/// fraction[l] on the upper one.
struct LaneTaps {
  const int* lower = nullptr;
  const float* fraction = nullptr;
};

/// out[lane, c] = the rows of matrix [row, c], c < width, interpolated.
void interpolate_rows(const LaneTaps& taps, int width, const float* matrix, float* out);

/// The same with the lane innermost: out[c, lane].
void interpolate_rows_transposed(const LaneTaps& taps, int width, const float* matrix, float* out);

/// Adjoint of interpolate_rows: grad_matrix [row, c] += interpolationᵀ grad [lane, c].
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix);

}  // namespace tomofield::kernels
