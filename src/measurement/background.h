#pragma once

#include "measurement/measurement.h"

/// Takes away the background of a bright series (Measurement::background): what a camera adds to
/// every pixel. Only a trial tells it from a specimen that fills the views.
namespace tomofield::measurement {

/// Subtracts a part (0 to 1) of the background from all rays, in place. No copy of the measurement
/// may share its rays.
void subtract_background(double part, Measurement& measurement);

/// Returns a copy without a part of the background, with rays of its own. `measurement` must have
/// all of its rays in this process, as that of a trial has (middle_rows()).
Measurement without_background(double part, const Measurement& measurement);

/// Returns the rays of a measurement, to be changed. No copy of the measurement may share them.
SlabViews& own_rays(Measurement& measurement);

/// Returns a copy with rays of its own. `measurement` must have all of its rays in this process, as
/// that of a trial has (middle_rows()).
Measurement with_own_rays(const Measurement& measurement);

}  // namespace tomofield::measurement
