#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/volume.h"
#include "evaluate/psnr.h"
#include "evaluate/ssim.h"

namespace tomofield::evaluate {

/// A box of voxels, zero-based, the last ones excluded.
struct Box {
  std::array<std::int64_t, 3> first{};  ///< x, y, z
  std::array<std::int64_t, 3> last{};
  base::Shape3 shape() const {
    return {last[0] - first[0], last[1] - first[1], last[2] - first[2]};
  }
};

/// Score of one volume against another.
struct Comparison {
  PsnrScore psnr;
  SsimScore ssim;
  Box box;  ///< the voxels compared, in the truth's coordinates
};

/// Scores two volumes of the same shape that are in memory.
Comparison compare(const base::Volume& reconstruction, const base::Volume& truth);

/// Scores an MRC volume against an MRC truth. Volumes of different sizes are
/// laid centre on centre ((n − common) / 2 voxels cut off before, the rest
/// behind) and the common box is compared, with a warning to base/log.h; so are
/// different voxel sizes. `box`, in voxels of the truth, restricts that further;
/// the peak is then that of the truth within it. Only the compared voxels are in memory.
///
/// Throws Error for volumes that cannot be meant for each other: axes in another
/// order, voxel sizes more than 5 % apart, or less than half of the truth in common
/// along some axis; and for a box that is empty or outside the common one.
Comparison compare_files(const std::filesystem::path& reconstruction,
                         const std::filesystem::path& truth, const std::optional<Box>& box);

/// The comparison as JSON; an infinite PSNR is written as null.
nlohmann::json comparison_json(const Comparison& comparison,
                               const std::filesystem::path& reconstruction,
                               const std::filesystem::path& truth);

}  // namespace tomofield::evaluate
