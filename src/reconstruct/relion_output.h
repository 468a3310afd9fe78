#pragma once

#include <filesystem>
#include <optional>

#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// Returns the path of the tomograms.star that a run writes beside its volume: NAME.star if the
/// series came from a tomograms.star of RELION, else nothing.
std::optional<std::filesystem::path> relion_output(const ReconstructOptions& options);

/// Writes it: the row of the tomogram with all its columns, the size and binning of the volume
/// whose contents are in the file `volume`, and where the volume, its halves and this regularised
/// (denoised) tomogram are. RELION takes the middle of a tomogram for the point about which the
/// series was aligned: for a volume that is a part, moved, or in another order of axes it writes
/// nothing and warns.
void write_relion_output(const ReconstructOptions& options, const std::filesystem::path& volume);

}  // namespace tomofield::reconstruction
