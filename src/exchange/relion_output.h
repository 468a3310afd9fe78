#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "io/tables/star_file.h"
#include "options/run_options.h"

namespace tomofield::exchange {

/// Returns the path of the tomograms.star that a run writes beside its volume: NAME.star if the
/// series came from a tomograms.star of RELION, else nothing.
std::optional<std::filesystem::path> relion_output(const options::ReconstructOptions& options);

/// Returns the name of the tomogram in that file, or nothing if none is written.
std::optional<std::string> relion_tomogram(const options::ReconstructOptions& options);

/// Reads the row that a run has written beside a volume. Returns nothing if there is none, or if
/// the file of that name is of something else.
std::optional<io::StarTable> read_relion_output(const std::filesystem::path& volume);

/// Writes it: the row of the tomogram with all its columns, the size and binning of the volume
/// whose contents are in the file `volume`, and where the volume, its linear halves
/// (--denoising-halves) and this regularised (denoised) tomogram are. It never names fitted halves.
/// With --align it names the new alignment of the views (relion_alignment.h). RELION takes the
/// middle of a tomogram for the point about which the series was aligned: for a volume that is a
/// part, moved, or in another order of axes it writes nothing, warns, and removes the row of an
/// earlier volume.
void write_relion_output(const options::ReconstructOptions& options,
                         const std::filesystem::path& volume);

}  // namespace tomofield::exchange
