#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "evaluate/box.h"
#include "evaluate/fsc.h"

namespace tomofield::evaluate {

/// The two files to correlate and the voxels of them that count.
struct FscFiles {
  std::filesystem::path first, second;
  std::optional<std::filesystem::path> mask;  ///< default: edge_window()
  std::optional<base::Box> box;               ///< in voxels of the second
  std::optional<TiltRange> tilts;
};

/// Computes the shell correlation of two MRC volumes, read as a pair (volume_pair.h). The mask is
/// an MRC volume of the size of the second, with weights from 0 to 1. Where the second's header has
/// no voxel size, frequencies count voxels, and a warning goes to base/log.h. Throws Error for
/// volumes that cannot be correlated, and if memory is too small.
Fsc correlate_files(const FscFiles& files);

/// Returns the correlation as JSON. A crossing that does not exist and an empty shell are null.
nlohmann::json fsc_json(const Fsc& fsc, const FscFiles& files);

/// Returns a table with a line a shell: its frequency, its resolution, and the correlation and the
/// number of Fourier voxels of each curve. An empty shell has an empty correlation.
std::string fsc_csv(const Fsc& fsc);

}  // namespace tomofield::evaluate
