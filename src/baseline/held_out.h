#pragma once

#include <vector>

#include "baseline/voxel_problem.h"
#include "measurement/view_residuals.h"

namespace tomofield::baseline {

/// Computes how well densities predict `views` (measurement::view_errors()). Writes the padding of
/// `densities`.
measurement::ViewErrors held_out_errors(const VoxelProblem& problem, const std::vector<int>& views,
                                        bool fit_view_scale, VoxelVolume& densities);

}  // namespace tomofield::baseline
