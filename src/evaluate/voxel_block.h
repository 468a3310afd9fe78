#pragma once

#include <cstdint>

#include "base/volume.h"

namespace tomofield::evaluate {

/// Voxels in memory, [section, row, x]: a volume, or a part of one.
struct VoxelBlock {
  const float* voxels = nullptr;
  base::Shape3 shape;
  std::int64_t row_stride = 0, section_stride = 0;  ///< in voxels

  const float* row(std::int64_t y, std::int64_t z) const {
    return voxels + z * section_stride + y * row_stride;
  }
  /// Returns the part of sections [first, first + count).
  VoxelBlock sections(std::int64_t first, std::int64_t count) const {
    return {row(0, first), {shape.nx, shape.ny, count}, row_stride, section_stride};
  }
};

inline VoxelBlock block_of(const base::Volume& volume) {
  const base::Shape3& shape = volume.shape;
  return {volume.data.data(), shape, shape.nx, shape.nx * shape.ny};
}

}  // namespace tomofield::evaluate
