#pragma once

namespace tomofield::kernels {

/// Places the kLanes rows of a slab between the rows of a matrix. Lane l interpolates matrix rows
/// lower[l] and lower[l] + 1, which both exist, with weight fraction[l] on the upper one.
struct LaneTaps {
  const int* lower = nullptr;
  const float* fraction = nullptr;
};

/// Writes the interpolated rows of matrix [row, c], c < width, to out[lane, c].
void interpolate_rows(const LaneTaps& taps, int width, const float* matrix, float* out);

/// Applies the adjoint of interpolate_rows: grad_matrix [row, c] += interpolationᵀ grad [lane, c].
void spread_rows(const LaneTaps& taps, int width, const float* grad, float* grad_matrix);

/// Transposes: columns[c, lane] = lanes[lane, c], c < width. The arrays must not overlap.
void transpose_lanes(int width, const float* lanes, float* columns);

/// Applies the adjoint of transpose_lanes: lanes[lane, c] += columns[c, lane].
void add_transposed(int width, const float* columns, float* lanes);

}  // namespace tomofield::kernels
