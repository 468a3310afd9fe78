#pragma once

#include <filesystem>
#include <vector>

#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::exchange {

/// Returns the descriptions of the volume that a run writes for other programs: a STAR file for
/// RELION, the alignment for the CryoET Data Portal.
std::vector<std::filesystem::path> volume_descriptions(const options::ReconstructOptions& options);

/// Returns all small files that a run writes for other programs beside its volume: those above, and
/// the files of its alignment (alignment_results()).
std::vector<std::filesystem::path> exchange_files(const options::ReconstructOptions& options);

/// Throws Error if a name that they would hold cannot be written.
void check_exchange_files(const options::ReconstructOptions& options);

/// Writes them. The volume's contents are in the file `volume` (Results, WriteMore).
void write_exchange_files(const tilt_series::PlannedSeries& series,
                          const options::ReconstructOptions& options,
                          const std::filesystem::path& volume);

}  // namespace tomofield::exchange
