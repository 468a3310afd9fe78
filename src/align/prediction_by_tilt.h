#pragma once

#include <vector>

#include "fit/fit.h"
#include "measurement/measurement.h"

namespace tomofield::alignment {

/// Returns the derivative of the prediction of each view by its tilt angle in degrees, [view][y,
/// x], as the difference between predictions at larger and smaller tilts. `measurement` must be
/// that of the fit; it comes back as it was. Every process calls it. It takes the memory of three
/// images of each view.
std::vector<std::vector<float>> predictions_by_tilt(measurement::Measurement& measurement,
                                                    fit::Fit& fit);

}  // namespace tomofield::alignment
