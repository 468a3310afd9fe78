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

/// A value may be as large as the third largest of the 26 values around it, and as small as the
/// third smallest. So a sheet of one vertex and a thread of two by two are left as they are, and a
/// single vertex or a pair is not.
inline constexpr int kSpikeRank = 3;

/// Moves values that are larger or smaller than that to the nearest value that is allowed. All
/// values change at once. Beyond the lattice, its outer layers are mirrored about its outermost
/// vertices. This is the LUM smoother (Hardie and Boncelet, IEEE Trans. Signal Process. 41, 1061,
/// 1993) on 3 × 3 × 3 vertices.
void limit_spikes(const LatticeShape& shape, float* values);

}  // namespace tomofield::kernels
