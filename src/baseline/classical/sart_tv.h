#pragma once

#include <nlohmann/json_fwd.hpp>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct SartTvOptions {
  int iterations = 20;
  int subsets = 10;         ///< interleaved subsets of views; at most one a view
  double relaxation = 1.0;  ///< in the first pass; times 0.97 in each pass after it
  int tv_steps = 20;        ///< steps down the variation after each pass
  double weight = 1.0;      ///< total length of these steps over the change by the pass
  bool non_negative = true;

  MethodFacts facts() const { return {"sart-tv", iterations, 5, 1, 3}; }
  nlohmann::json json() const;
};

/// Reconstructs by ordered-subset SART (Andersen and Kak 1984) with steps down the total variation
/// between its passes, as in ASD-POCS (Sidky and Pan 2008). A pass takes the step of row_action.h
/// with each subset in turn. Then `tv_steps` steps of length
///   weight · |x after the pass − x before| / tv_steps
/// reduce the variation (variation_descent.h), so they shrink as the data are met. The relaxation
/// shrinks as well; otherwise the subsets would pull to and fro for ever. The method has no
/// objective, so the solution reports its data loss as one. `start` is the density of every voxel
/// at first. Memory: five volumes and the rays.
Solution reconstruct_sart_tv(VoxelProblem& problem, const SartTvOptions& options, double start,
                             const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
