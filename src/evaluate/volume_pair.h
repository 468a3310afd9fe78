#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/volume.h"
#include "evaluate/box.h"
#include "tomofield/options.h"

namespace tomofield::evaluate {

/// The numbers of voxels along x, y and z.
using VolumeSizes = std::array<std::int64_t, 3>;

/// Returns true if both voxel sizes (Å) are known and differ by more than `tolerance` times the
/// second.
bool voxel_sizes_differ(double first_A, double second_A, double tolerance);
constexpr double kMaxScaleDifference = 0.05;  ///< for read_pair()

/// Returns the voxel size (Å) of two volumes that are compared voxel by voxel: the known one, or 0.
/// Warns if they differ, with the names of both, and throws Error if both are known and differ by
/// more than kMaxScaleDifference.
double common_voxel_size_A(const std::string& first, double first_A, const std::string& second,
                           double second_A);

/// Returns where the corner of a volume lies in the whole in Å, along its axes, if tomofield wrote
/// it and did not turn it: its ORIGIN.
std::optional<std::array<double, 3>> place_A(const io::MrcReader& volume);

/// Tells whether a place is the lower corner of a region, which has pixels of this size.
bool lies_at(const std::array<double, 3>& place_A, const Rectangle& region, double pixel_size_A);

/// Tells whether tomofield turned a volume before it was sampled.
bool is_turned(const io::MrcReader& volume);

/// Throws Error if a volume is a part of another one, as its place says, or was turned: positions
/// in the whole are not its own.
void require_whole(const std::filesystem::path& volume);

/// Returns true if the axes of one of two volumes, which read_pair() would lay centre on centre,
/// are in another order than the other's.
bool have_axes_in_another_order(const VolumeSizes& first, const VolumeSizes& second);
/// Returns true if at least half of each volume is in the other along every axis, laid centre on
/// centre.
bool share_half(const VolumeSizes& first, const VolumeSizes& second);

/// Two volumes of one shape, compared voxel by voxel.
struct VolumePair {
  base::Volume first, second;
  base::Box box;  ///< their place in the second file, in its voxels
};

/// Reads an MRC volume and the one that it is compared with. Only the voxels of the box are in
/// memory.
///
/// The ORIGINs place the volumes where they make one a part of the other. ORIGINs
/// that are equal count only if tomofield wrote both. Other volumes of different sizes are laid
/// centre on centre: (n − common) / 2 voxels are cut off before and the rest behind. Their common
/// box is read, with a warning to base/log.h. Different voxel sizes cause a warning too. `box`, in
/// voxels of the second, restricts the common box further.
///
/// Throws Error for volumes that cannot be meant for each other: axes in another order, voxel sizes
/// more than 5 % apart, two places of one volume that tomofield wrote, or, laid centre on centre,
/// less than half of one in the other along some axis. Throws Error for a box that is empty or not
/// within the common one.
VolumePair read_pair(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<base::Box>& box);

}  // namespace tomofield::evaluate
