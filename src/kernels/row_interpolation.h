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

/// Adjoint of interpolate_rows: grad_matrix [row, c] += interpolationᵀ grad [lane, c].
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix);

/// columns[c, lane] = lanes[lane, c], c < width. They must not overlap.
void transpose_lanes(int width, const float* lanes, float* columns);

/// Its adjoint: lanes[lane, c] += columns[c, lane].
void add_transposed(int width, const float* columns, float* lanes);

}  // namespace tomofield::kernels
