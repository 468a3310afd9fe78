#pragma once

#include <span>

#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// Warns of views whose mean grey level, one a view in `levels`, is far from that of their
/// neighbours in tilt: by three times the noise and a quarter of the usual level, and by ten times
/// what views usually differ from their neighbours.
void warn_of_levels(const tilt_series::TiltSeries& series, std::span<const double> levels);

/// Throws Error if both the contrast and the noise of a view are more than 1000 times, or less than
/// a 1000th of, the median of all views: its numbers are in other units, and it alone would decide
/// the fit. Warns from a factor of 30 on. `contrasts` has the standard deviation of each view
/// without its noise, in the units of the series; 0 is unknown.
void require_common_units(const tilt_series::TiltSeries& series, std::span<const double> contrasts);

}  // namespace tomofield::measurement
