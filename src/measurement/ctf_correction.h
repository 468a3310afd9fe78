#pragma once

#include "measurement/measurement.h"
#include "microscope/view_filter.h"

namespace tomofield::measurement {

/// Corrects the contrast transfer of the views of a measurement that has transfers, so that methods
/// without one can use them: each place of a view with its own defocus, that of the middle plane of
/// the specimen. Pixels that do not count stay so, and the view's mean stands for them. The
/// measurement has no transfers any more. Its rays become its own. The noise of the views keeps its
/// standard deviation in its record, though multiplying and Wiener's filter change it.
void correct_ctf(microscope::CtfCorrection correction, Measurement& measurement);

}  // namespace tomofield::measurement
