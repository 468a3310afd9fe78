#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "io/output_lock.h"
#include "reconstruct/options.h"
#include "report/curve_plot.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// Returns the files of an alignment that a run with --align writes beside its volume:
/// NAME_align.xf, .tlt, .xtilt, .aln and .png, and .star for views of RELION. None without --align.
std::vector<std::filesystem::path> alignment_results(const ReconstructOptions& options);

/// Checks the options of an alignment without a reconstruction and locks its files, as
/// claim_outputs() does for a reconstruction. Throws Error if they name no output.
std::vector<io::OutputLock> claim_alignment(const ReconstructOptions& options);

/// Writes them for an aligned series (aligned_series.h).
void write_alignment_results(const tilt_series::TiltSeries& series,
                             const ReconstructOptions& options);

/// Returns plots of an alignment in the metrics over the tilt: the changes of shift, rotation and
/// magnification, the agreement with the projections, and the error of the shifts.
std::vector<report::CurvePlot> alignment_plots(const nlohmann::json& record);

}  // namespace tomofield::reconstruction
