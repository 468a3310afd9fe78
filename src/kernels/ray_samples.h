#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/leaf_decoding.h"

namespace tomofield::kernels {

/// The vertices of one leaf, [x, z, y].
struct LeafVertices {
  int nx = 0, nz = 0, ny = 0;
  std::size_t size() const { return static_cast<std::size_t>(nx) * nz * ny; }
};

/// The piece of a ray inside one leaf, cut into num_samples segments of equal
/// length with one random sample in each (eq. 10): segment i has its sample at
/// the share (i + random_unit(key, i)) / num_samples of the way from `start`
/// along `span`, both in vertex spacings; samples past the outer vertices read those.
struct RayPiece {
  float start_x = 0, start_y = 0, start_z = 0;
  float span_x = 0, span_y = 0, span_z = 0;
  float segment_length = 0;  ///< in pixels: the weight of a sample
  std::uint32_t key = 0;     ///< of the piece's random numbers
  int num_samples = 0;
};

/// Mixes 32 bits (Wellons' lowbias32): a counter-based random number.
inline std::uint32_t mix_bits(std::uint32_t x) {
  x = (x ^ x >> 16) * 0x7feb352dU;
  x = (x ^ x >> 15) * 0x846ca68bU;
  return x ^ x >> 16;
}

/// Random number `index` of a key, uniform in [0, 1).
inline float random_unit(std::uint32_t key, int index) {
  const std::uint32_t counter = key + static_cast<std::uint32_t>(index) * 0x9e3779b9U;
  return static_cast<float>(mix_bits(counter) >> 8) * 0x1p-24f;
}

/// Floats that a piece of `num_samples` keeps in `densities`.
inline std::size_t padded_samples(int num_samples) {
  return (static_cast<std::size_t>(num_samples) + 15) / 16 * 16;
}

/// Σ segment_length · act(trilinear interpolation of `values`) over the samples
/// of a piece, whose densities it stores (padded_samples of them).
double integrate_piece(const LeafVertices& leaf, Activation activation, const float* values,
                       const RayPiece& piece, float* densities);

/// Adjoint of that at the stored densities: given g = dL/d sum, adds dL/d values
/// to grad_values and returns Σ dL/d pre-activation, the bias's derivative.
double spread_piece(const LeafVertices& leaf, Activation activation, const RayPiece& piece,
                    const float* densities, float g, float* grad_values);

}  // namespace tomofield::kernels
