#pragma once

#include <vector>

namespace tomofield::baseline {

/// The part of the half circle that each tilt stands for, in radians: half the distances to its
/// neighbours in order of tilt, 180° being 0° again. Beyond the first and the last tilt no more
/// than the mean spacing counts, so that the missing wedge is nobody's.
std::vector<double> tilt_weights(const std::vector<double>& tilt_deg);

}  // namespace tomofield::baseline
