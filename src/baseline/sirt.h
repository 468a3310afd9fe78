#pragma once

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct SirtOptions {
  int iterations = 40;      ///< best for noisy phantoms, docs/results/quality.md
  double relaxation = 1.0;  ///< converges for 0 < relaxation < 2
  bool non_negative = true;
  bool fit_view_scale = false;  ///< per-view scale and offset as nuisances
};

/// Simultaneous iterative reconstruction (Gilbert 1972), weighted, from zero densities:
///   x ← x + relaxation · C Aᵀ R W (b − A x)
/// with R the inverse row sums of A, W = 1/σ² of each view, and C the inverse column
/// sums of W A over the rays that count. It minimises ½ Σ (residual / σ)² / ray length,
/// has no prior, and is therefore stopped before it has fitted the noise.
Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
