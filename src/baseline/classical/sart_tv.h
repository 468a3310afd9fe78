#pragma once

#include <nlohmann/json_fwd.hpp>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct SartTvOptions {
  int iterations = 20;
  int subsets = 10;         ///< of the views, interleaved; at most one a view
  double relaxation = 1.0;  ///< of the first pass; falls by kFall each
  int tv_steps = 20;        ///< after each pass
  double weight = 1.0;      ///< their length altogether, over the change that the pass made
  bool non_negative = true;

  MethodFacts facts() const { return {"sart-tv", iterations, 5, 1, 3}; }
  nlohmann::json json() const;
};

/// Ordered-subset SART (Andersen and Kak 1984) with steps down the total variation between its
/// passes, as ASD-POCS (Sidky and Pan 2008) has them. A pass takes the step of row_action.h with
/// each of the subsets in turn; then the variation is reduced by `tv_steps` steps of
///   weight · |x after the pass − x before| / tv_steps
/// (variation_descent.h), so that they shrink as the data are met. The relaxation shrinks as well,
/// or the subsets would pull to and fro for ever. There is no objective: that of the
/// solution is its data loss. Starts from `start` everywhere. Memory: five volumes and the rays.
Solution reconstruct_sart_tv(VoxelProblem& problem, const SartTvOptions& options, double start,
                             const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
