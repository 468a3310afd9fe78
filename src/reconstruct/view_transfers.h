#pragma once

#include <vector>

#include "microscope/view_filter.h"
#include "reconstruct/options.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// Returns what the microscope did to each aligned view of a series, as the options for contrast
/// transfer and dose say: [view], with pixels of `series`. It is empty if the options name neither
/// a contrast transfer nor a dose, so that the views are plain projections. The defocus is that on
/// the tilt axis, and its slope is that of the middle plane of the specimen, whose hand is --hand.
/// Doses come from --dose-per-tilt, else from --mdoc, else from the table of views that is the
/// stack. Logs what it took. Throws Error if the pixel size is not known, and for a file that is
/// not of this stack or has no defocus of a view.
std::vector<microscope::ViewTransfer> view_transfers(const ReconstructOptions& options,
                                                     const tilt_series::TiltSeries& series);

}  // namespace tomofield::reconstruction
