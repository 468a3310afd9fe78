#pragma once

#include <filesystem>
#include <optional>

#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::exchange {

/// Returns the path of the tilt-series STAR file that a run with --align writes: NAME_align.star if
/// the views came from such a file of RELION, else nothing.
std::optional<std::filesystem::path> relion_alignment(const options::ReconstructOptions& options);

/// Writes it: the rows of the views of the aligned series with all their columns, and the angles
/// and shifts of the new alignment. RELION has no magnifications, so they are lost.
void write_relion_alignment(const tilt_series::PlannedSeries& series,
                            const options::ReconstructOptions& options);

}  // namespace tomofield::exchange
