#pragma once

#include <complex>
#include <vector>

#include "base/volume.h"

namespace tomofield::evaluate {

/// Computes the discrete Fourier transform in three dimensions, in place and not normalised:
///   values[u] ← Σ_x values[x] exp(−2πi Σ_axis u x / n).
/// `values` is [z, y, x] in single precision. Any size works; products of small primes are fast.
void transform_volume(const base::Shape3& shape, std::vector<std::complex<float>>& values);

/// Returns the frequency of an index in cycles over an axis of n samples: 0, 1 … −1, the order of
/// numpy's fftfreq.
inline std::int64_t signed_frequency(std::int64_t index, std::int64_t n) {
  return index < (n + 1) / 2 ? index : index - n;
}

}  // namespace tomofield::evaluate
