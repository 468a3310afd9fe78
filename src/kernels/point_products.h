#pragma once

#include "kernels/leaf_decoding.h"

namespace tomofield::kernels {

/// One product of eq. 4 at scattered points: value(p) = Σ_r V_r(a) M_r(b, c). The vector
/// V [na, rank] and the matrix M [nb, nc, rank] are interpolated linearly. The taps of the three
/// axes have one entry a point.
struct PointProducts {
  AxisTaps a, b, c;
  int nc = 0;
  int rank = 0;
};

/// Adds the product at each point to values[point].
void add_point_products(const PointProducts& points, const float* vector, const float* matrix,
                        float* values);

/// Applies the adjoint: adds dL/dV and dL/dM, given dL/d values.
void add_point_products_gradient(const PointProducts& points, const float* vector,
                                 const float* matrix, const float* grad_values, float* grad_vector,
                                 float* grad_matrix);

}  // namespace tomofield::kernels
