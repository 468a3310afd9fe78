#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// Voxels along x, y and z.
using VolumeSizes = std::array<std::int64_t, 3>;

/// 0 and 1 Å are what programs write that do not know.
bool is_known_voxel_size(double voxel_A);
/// Whether both voxel sizes (Å) are known and further apart than this part of the second.
bool voxel_sizes_differ(double first_A, double second_A, double tolerance);
constexpr double kMostScaleDifference = 0.05;  ///< of volumes that are read as a pair

/// Of volumes of these sizes, which read_pair() would lay centre on centre: whether the axes of one
/// are in another order, and whether at least half of each is in the other along every axis.
bool have_axes_in_another_order(const VolumeSizes& first, const VolumeSizes& second);
bool share_half(const VolumeSizes& first, const VolumeSizes& second);

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
