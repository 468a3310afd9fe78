#pragma once

#include <vector>

namespace tomofield::baseline {

/// Returns the part of the half circle that each tilt stands for, in radians: half of the distances
/// to its neighbours in the order of tilts, where 180° is 0° again. Beyond the first and the last
/// tilt at most the mean spacing counts, so that no tilt stands for the missing wedge.
std::vector<double> tilt_weights(const std::vector<double>& tilt_deg);

}  // namespace tomofield::baseline
