#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "evaluate/box.h"
#include "evaluate/fsc.h"

namespace tomofield::evaluate {

/// Which files to correlate, and how.
struct FscFiles {
  std::filesystem::path first, second;
  std::optional<std::filesystem::path> mask;  ///< default: edge_window()
  std::optional<Box> box;                     ///< in voxels of the second
  std::optional<TiltRange> tilts;
};

/// Shell correlation of two MRC volumes, read as a pair (volume_pair.h). The mask is an
/// MRC volume of the size of the second with weights from 0 to 1. Without a voxel
/// size in the second's header frequencies count voxels, with a warning to base/log.h.
/// Throws Error for what cannot be correlated, and if memory is too small.
Fsc correlate_files(const FscFiles& files);

/// Everything about a correlation; crossings that there are not, and empty shells, are null.
nlohmann::json fsc_json(const Fsc& fsc, const FscFiles& files);

/// A line a shell: frequency, resolution, and of each curve its correlation and
/// number of Fourier voxels. Empty shells have an empty correlation.
std::string fsc_csv(const Fsc& fsc);

}  // namespace tomofield::evaluate
