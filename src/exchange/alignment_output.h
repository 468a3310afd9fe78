#pragma once

#include <filesystem>
#include <vector>

#include "io/saving/output_lock.h"
#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::exchange {

/// Returns the files of an alignment that a run with --align writes beside its volume:
/// NAME_align.xf, .tlt, .xtilt, .aln and .png, and .star for views of RELION. None without --align.
std::vector<std::filesystem::path> alignment_results(const options::ReconstructOptions& options);

/// Checks the options of an alignment without a reconstruction and locks its files, as
/// claim_outputs() does for a reconstruction. Throws Error if they name no output.
std::vector<io::OutputLock> claim_alignment(const options::ReconstructOptions& options);

/// Writes them for an aligned series (realign/aligned_series.h).
void write_alignment_results(const tilt_series::PlannedSeries& series,
                             const options::ReconstructOptions& options);

}  // namespace tomofield::exchange
