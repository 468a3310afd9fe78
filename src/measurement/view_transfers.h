#pragma once

#include <vector>

#include "microscope/view_transfer.h"
#include "tilt_series/planned_series.h"
#include "tomofield/options.h"

namespace tomofield::measurement {

/// Returns true if a file has the contrast transfer of the views; --ctf none names no file.
inline bool has_ctf_file(const SeriesFiles& files) { return files.ctf && *files.ctf != "none"; }

/// Returns true if the contrast transfer of the views is known.
inline bool has_ctf(const SeriesFiles& files, const ViewOptions& options) {
  return has_ctf_file(files) || options.defocus_um;
}

/// Returns true if the options ask for transfers of the views.
inline bool wants_transfers(const SeriesFiles& files, const ViewOptions& options) {
  return has_ctf(files, options) || options.dose_per_tilt.value_or(0.0) > 0.0 || files.mtf;
}

/// Returns a sentence for each option of contrast transfer and dose that does not go with others.
std::vector<const char*> faults_of_transfer(const SeriesFiles& files, const ViewOptions& options);

/// Returns what the microscope did to each aligned view of a series, as the options for contrast
/// transfer and dose say: [view], with pixels of `series`. `input` is what the series was read by,
/// and `hand` is SpecimenOptions::hand. The result is empty if the options name neither a contrast
/// transfer nor a dose nor a detector, so that the views are plain projections. The defocus is that
/// on the tilt axis, and its slope is that of the middle plane of the specimen, on the side that
/// --defocus-hand says, else the file of --ctf, else --hand. find_exposures() says where doses come
/// from. Logs what it took. Throws Error if the pixel size is not
/// known, and for a file that is not of this stack or has no defocus of a view.
std::vector<microscope::ViewTransfer> view_transfers(const tilt_series::TiltSeriesOptions& input,
                                                     int hand,
                                                     const tilt_series::PlannedSeries& series);

}  // namespace tomofield::measurement
