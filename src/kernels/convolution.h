#pragma once

#include <cstddef>

#include "base/range.h"

namespace tomofield::kernels {

/// Channels of voxels in memory, [channel, z, y, x]. A border of one voxel surrounds those of a
/// channel, and a few floats end each row, so that a kernel can read whole vectors.
struct ChannelShape {
  int nx = 0, ny = 0, nz = 0;  ///< voxels without the border; at least 1

  std::ptrdiff_t stride_y() const { return (nx + 2 + kRowEnd - 1) / kRowEnd * kRowEnd + kRowEnd; }
  std::ptrdiff_t stride_z() const { return stride_y() * (ny + 2); }
  std::ptrdiff_t stride_channel() const { return stride_z() * (nz + 2); }
  /// Returns the place of a voxel of the first channel; −1 and n are those of the border.
  std::ptrdiff_t at(int x, int y, int z) const {
    return (z + 1) * stride_z() + (y + 1) * stride_y() + (x + 1);
  }

 private:
  static constexpr std::ptrdiff_t kRowEnd = 16;
};

/// Channels of the output are computed in groups of this size.
inline constexpr int kOutputsTogether = 8;

/// A convolution of channels by filters of 3 × 3 × 3 taps without a bias, and the activation that
/// follows it: max(s, slope · s) with 0 ≤ slope ≤ 1. A slope of 1 is none.
struct Convolution {
  int num_in = 1;
  int num_out = kOutputsTogether;  ///< a multiple of kOutputsTogether
  float slope = 1.0f;
  /// [group of outputs, input, tap, output in its group]; taps are [z, y, x]
  const float* weights = nullptr;
};

/// Computes out[o](x, y, z) = act(Σ_i Σ_t w[o, i, t] in[i]((x, y, z) + t − 1)) for the voxels of
/// some planes z. Reads the border of `in` and leaves that of `out` as it is.
void convolve(const ChannelShape& shape, const Convolution& convolution, base::Range planes,
              const float* in, float* out);

}  // namespace tomofield::kernels
