#pragma once

#include <nlohmann/json_fwd.hpp>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct SirtOptions {
  int iterations = 40;      ///< best on phantoms with noise 0.05, docs/results/noise.md
  double relaxation = 1.0;  ///< converges for 0 < relaxation < 2
  bool non_negative = true;

  MethodFacts facts() const { return {"sirt", iterations, 2, 1}; }
  nlohmann::json json() const;
};

/// Reconstructs by weighted simultaneous iterative reconstruction (Gilbert 1972) from zero
/// densities. An iteration is the step of row_action.h with all views at once. It minimises
///   ½ Σ (residual / σ)² / ray length.
/// The method has no prior, and must therefore stop before it has fitted the noise.
Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
