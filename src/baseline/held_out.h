#pragma once

#include <vector>

#include "baseline/voxel_problem.h"
#include "measurement/view_errors.h"

namespace tomofield::baseline {

/// How well densities, whose padding it writes, predict views (evaluate/view_errors.h).
measurement::ViewErrors held_out_errors(const VoxelProblem& problem, const std::vector<int>& views,
                                        bool fit_view_scale, VoxelVolume& densities);

}  // namespace tomofield::baseline
