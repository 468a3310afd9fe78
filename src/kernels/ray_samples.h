#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/leaf_decoding.h"

namespace tomofield::kernels {

/// The vertex counts of one leaf, whose values are [x, z, y].
struct LeafVertices {
  int nx = 0, nz = 0, ny = 0;
  std::size_t size() const { return static_cast<std::size_t>(nx) * nz * ny; }
};

/// The piece of a ray inside one leaf, cut into num_samples segments of equal length with one
/// random sample in each (eq. 10). The sample of segment i is at the fraction (i + random_unit(key,
/// i)) / num_samples of the way from `start` along `span`. Both are in vertex spacings. Samples
/// beyond the outer vertices take the nearest vertex's value.
struct RayPiece {
  float start_x = 0, start_y = 0, start_z = 0;
  float span_x = 0, span_y = 0, span_z = 0;
  float segment_length = 0;  ///< length in pixels; the weight of a sample
  std::uint32_t key = 0;     ///< key of the piece's random numbers
  int num_samples = 0;
};

/// Mixes 32 bits (lowbias32 by Wellons), which makes a counter-based random number.
inline std::uint32_t mix_bits(std::uint32_t x) {
  x = (x ^ x >> 16) * 0x7feb352dU;
  x = (x ^ x >> 15) * 0x846ca68bU;
  return x ^ x >> 16;
}

/// Returns random number `index` of a key, uniform in [0, 1).
inline float random_unit(std::uint32_t key, int index) {
  const std::uint32_t counter = key + static_cast<std::uint32_t>(index) * 0x9e3779b9U;
  return static_cast<float>(mix_bits(counter) >> 8) * 0x1p-24f;
}

/// Returns the number of floats that a piece of `num_samples` occupies in `densities`.
inline std::size_t padded_samples(int num_samples) {
  return (static_cast<std::size_t>(num_samples) + 15) / 16 * 16;
}

/// Returns Σ segment_length · act(trilinear interpolation of `values`) over the samples of a piece.
/// Stores their densities, padded_samples() floats.
double integrate_piece(const LeafVertices& leaf, Activation activation, const float* values,
                       const RayPiece& piece, float* densities);

/// Applies the adjoint at the stored densities: given g = dL/d sum, adds dL/d values to grad_values
/// and returns Σ dL/d pre-activation, the derivative with respect to the bias.
double spread_piece(const LeafVertices& leaf, Activation activation, const RayPiece& piece,
                    const float* densities, float g, float* grad_values);

}  // namespace tomofield::kernels
