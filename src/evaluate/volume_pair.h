#pragma once

#include <filesystem>
#include <optional>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// Two volumes of one shape, voxel on voxel.
struct VolumePair {
  base::Volume first, second;
  Box box;  ///< where they lie in the second file, in voxels of it
};

/// Reads an MRC volume and the one that it is held against. Where their ORIGINs (IMOD's sign) make
/// one a part of the other, they say where it lies; ORIGINs that are equal count only if tomofield
/// wrote both. Other volumes of different sizes are laid centre on centre ((n − common) / 2 voxels
/// cut off before, the rest behind) and the common box is read, with a warning to base/log.h; so
/// are different voxel sizes. `box`, in voxels of the second, restricts that further.
/// Only the voxels of the box are in memory.
///
/// Throws Error for volumes that cannot be meant for each other: axes in another
/// order, voxel sizes more than 5 % apart, or, laid centre on centre, less than half of one in the
/// other along some axis; and for a box that is empty or outside the common one.
VolumePair read_pair(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<Box>& box);

}  // namespace tomofield::evaluate
