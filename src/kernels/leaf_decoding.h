#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// Places samples between the vertices of one axis. Sample s interpolates vertices lower[s] and
/// lower[s] + 1, which both exist, with weight fraction[s] on the upper one.
struct AxisTaps {
  int count = 0;
  const int* lower = nullptr;
  const float* fraction = nullptr;
};

/// The function that turns values into densities (docs/model-format.md): softplus with sharpness β,
/// log(1 + e^(βa)) / β, or the identity if beta is 0.
struct Activation {
  float beta = 0.0f;
};

/// One leaf's piece of a slab, with vertex values [x, z, lane] and samples at
/// samples[z stride_z + x kLanes + lane].
struct LeafPiece {
  int num_vertices_z = 0;
  AxisTaps x, z;
  std::ptrdiff_t stride_z = 0;
  Activation activation;
};

/// Decodes samples = act(bilinear interpolation of `values` in x and z). This completes the
/// trilinear interpolation of eq. 4, because the values are already interpolated in y.
void decode_leaf(const LeafPiece& piece, const float* values, float* samples);

/// Applies the adjoint: grad_values += interpolationᵀ (grad_samples · act′). It computes act′ from
/// the decoded `samples` f: 1 − e^(−βf) for softplus. Returns Σ grad_samples · act′, the derivative
/// with respect to the decoder's bias.
double decode_leaf_adjoint(const LeafPiece& piece, const float* samples, const float* grad_samples,
                           float* grad_values);

/// Replaces values by act(values), for `count` values in any layout.
void activate(Activation activation, float* values, std::ptrdiff_t count);

}  // namespace tomofield::kernels
