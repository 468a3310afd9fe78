#pragma once

#include "measurement/measurement.h"

namespace tomofield::measurement {

/// Returns the rays of a measurement, to be changed. No copy of the measurement may share them.
SlabViews& own_rays(Measurement& measurement);

/// Returns a copy with rays of its own. `measurement` must have all of its rays in this process, as
/// that of a trial has (middle_rows()).
Measurement with_own_rays(const Measurement& measurement);

}  // namespace tomofield::measurement
