#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// Numbers of vertices along each axis of a lattice [x, z, y]; at least 1.
struct LatticeShape {
  int nx = 0, ny = 0, nz = 0;
  std::size_t size() const {
    return static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny) *
           static_cast<std::size_t>(nz);
  }
};

/// The largest rank that limit_spikes() takes.
inline constexpr int kMostSpikeRank = 8;

/// Moves values that stand out from those around them back: a value may be as large as the
/// `rank`-th largest of the 26 values around it, and as small as the `rank`-th smallest. With rank
/// 3, a sheet of one vertex and a thread of two by two are left as they are, and a single vertex or
/// a pair is not. With rank 8, threads of one by two vertices go as well. All values change at
/// once. Beyond the lattice, its outer layers are mirrored about its outermost vertices. `rank` is
/// from 1 to kMostSpikeRank. This is the LUM smoother (Hardie and Boncelet, IEEE Trans. Signal
/// Process. 41, 1061, 1993) on 3 × 3 × 3 vertices.
void limit_spikes(const LatticeShape& shape, int rank, float* values);

}  // namespace tomofield::kernels
