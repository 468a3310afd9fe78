#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// Where samples lie between vertices on one axis: sample s
/// interpolates vertices lower[s] and lower[s] + 1, which both exist, with weight
/// fraction[s] on the upper one.
struct AxisTaps {
  int count = 0;
  const int* lower = nullptr;
  const float* fraction = nullptr;
};

/// How values become densities (DESIGN §1): softplus with sharpness beta,
/// log(1 + e^(βa)) / β, or the identity when beta is 0.
struct Activation {
  float beta = 0.0f;
};

/// One leaf's piece of a slab: vertex values [x, z, lane] and samples at
/// samples[z stride_z + x kLanes + lane].
struct LeafPiece {
  int num_vertices_z = 0;
  AxisTaps x, z;
  std::ptrdiff_t stride_z = 0;
  Activation activation;
};

/// samples = act(bilinear interpolation of `values` in x and z): the trilinear
/// pre-activation of eq. 4 (y was interpolated into the lanes already).
void decode_leaf(const LeafPiece& piece, const float* values, float* samples);

/// Adjoint: grad_values += interpolationᵀ (grad_samples · act′), with act′ from
/// the decoded `samples` themselves: 1 − e^(−βf) for softplus.
/// Returns Σ grad_samples · act′, the derivative by the decoder's bias.
double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* grad_values);

/// values = act(values), for values that are not in slab layout. `count` is any.
void activate(Activation activation, float* values, std::ptrdiff_t count);

}  // namespace tomofield::kernels
