#pragma once

#include <complex>
#include <vector>

#include "base/volume.h"

namespace tomofield::evaluate {

/// Discrete Fourier transform in three dimensions, in place, not normalised:
///   values[u] ← Σ_x values[x] exp(−2πi Σ_axis u x / n).
/// [z, y, x], any sizes (quick for products of small primes), single precision.
void transform_volume(const base::Shape3& shape, std::vector<std::complex<float>>& values);

/// Frequency of an index in cycles over an axis of n: 0, 1 … −1, as numpy's fftfreq.
inline std::int64_t signed_frequency(std::int64_t index, std::int64_t n) {
  return index < (n + 1) / 2 ? index : index - n;
}

}  // namespace tomofield::evaluate
