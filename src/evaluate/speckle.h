#pragma once

#include <cstdint>
#include <optional>

#include "base/volume.h"
#include "evaluate/voxel_block.h"

namespace tomofield::evaluate {

/// A speckle is a voxel that lies further than one standard deviation of the volume from the median
/// of the 3 × 3 × 3 voxels around it, itself included. Voxels at the faces of the volume, which
/// lack some of these neighbours, are left out.

/// Counts the speckles of a block. The block's outermost voxels are neighbours only.
/// `deviation` is the standard deviation of the volume that the block is from.
std::int64_t count_speckles(const VoxelBlock& block, double deviation);

/// Returns the number of voxels of which count_speckles() counts speckles, all but the outermost.
std::int64_t num_inner_voxels(const base::Shape3& shape);

/// Returns the fraction of a volume's inner voxels that are speckles; nothing if the volume has
/// less than 3 voxels along an axis. Throws Error for voxels that are not finite.
std::optional<double> speckle(const base::Volume& volume);

}  // namespace tomofield::evaluate
