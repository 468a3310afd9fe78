#pragma once

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct TvOptions {
  int iterations = 200;  ///< docs/results/quality.md
  double weight = 3.0;   ///< λ, see reconstruct_tv
  bool non_negative = true;
  bool fit_view_scale = false;  ///< per-view scale and offset as nuisances
};

/// Least squares with isotropic total variation:
///   min over x (>= 0)   ½ Σ ((A x − b) / σ_view)² + λ Σ h_x h_z |∇x|
/// over the rays that count and over the samples, with forward differences
/// divided by the sample spacing (1 in y). Densities are in density units, so
/// that λ has the meaning of the main method's density variation weight.
///
/// Solved by the primal–dual hybrid gradient method of Chambolle and Pock (2011),
/// with the diagonal preconditioning of Pock and Chambolle (2011), eq. 10 with
/// α = 1, over-relaxed after Condat (2013). `start` is the density of every voxel
/// at first. Memory: five volumes, the rays and a dual of each ray.
Solution reconstruct_tv(VoxelProblem& problem, const TvOptions& options, double start,
                        const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
