#pragma once

#include <span>

#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// Throws Error if both the contrast and the noise of a view are more than 1000 times, or less than
/// a 1000th of, the median of all views: its numbers are in other units, and it alone would decide
/// the fit. Warns from a factor of 30 on. `contrasts` has the standard deviation of each view
/// without its noise, in the units of the series; 0 is unknown.
void require_common_units(const tilt_series::TiltSeries& series, std::span<const double> contrasts);

}  // namespace tomofield::measurement
