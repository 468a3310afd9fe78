#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "io/images/mrc.h"

namespace tomofield::evaluate {

/// Side of the box over which write_uncertainty() averages, in voxels.
constexpr std::int64_t kUncertaintyBox = 7;

/// Writes the standard error of the mean of two MRC volumes a and b of one size, as they show it:
///   u(x) = ½ √⟨(a − b)²⟩,
/// where ⟨⟩ is the mean over the box of 7 × 7 × 7 voxels around x, as far as it lies within the
/// volume. If the errors of a and b are independent and their variance is σ² around x, u estimates
/// σ / √2, the standard deviation of (a + b) / 2. A box of sections is in memory at a time.
void write_uncertainty(const std::filesystem::path& first, const std::filesystem::path& second,
                       const std::filesystem::path& path);

/// Returns a float volume with the size, the voxel size and the origin of another one.
io::MrcSpec map_like(const io::MrcHeader& header, const std::string& what);

}  // namespace tomofield::evaluate
