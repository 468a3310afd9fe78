#pragma once

#include <cstdint>
#include <optional>

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

/// Returns a whole volume as a block.
inline VoxelBlock block_of(const base::Volume& volume) {
  const base::Shape3& shape = volume.shape;
  return {volume.data.data(), shape, shape.nx, shape.nx * shape.ny};
}

// A speckle is a voxel that lies further than one standard deviation of the volume from the median
// of the 3 × 3 × 3 voxels around it, itself included. Voxels at the faces of the volume, which
// lack some of these neighbours, are left out.

/// Counts the speckles of a block. The block's outermost voxels are neighbours only.
/// `deviation` is the standard deviation of the volume that the block is from.
std::int64_t count_speckles(const VoxelBlock& block, double deviation);

/// Returns the number of voxels of which count_speckles() counts speckles, all but the outermost.
std::int64_t num_inner_voxels(const base::Shape3& shape);

/// Returns the fraction of a volume's inner voxels that are speckles; nothing if the volume has
/// less than 3 voxels along an axis. Throws Error for voxels that are not finite.
std::optional<double> speckle(const base::Volume& volume);

}  // namespace tomofield::evaluate
