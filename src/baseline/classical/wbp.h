#pragma once

#include <nlohmann/json_fwd.hpp>

#include "baseline/classical/ramp_filter.h"
#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

struct WbpOptions {
  RampFilterOptions filter;

  MethodFacts facts() const { return {"wbp", 1, 1, 1}; }
  nlohmann::json json() const;
};

/// Reconstructs by weighted back-projection (Gilbert 1972; Kak and Slaney 1988, chapter 3):
///   x = x₀ + Σ_view Δθ_view / (h_x h_z) Aᵀ_view (ramp ∗ (b − A x₀))
/// with Δθ of tilt_weights(). Rays that do not count are bridged (bridge_gaps.h). Neither the noise
/// of a view nor a fitted scale plays a part. Densities may be negative.
///
/// If the specimen ends inside the field of view (no margins), x₀ is 0. If it goes on, x₀ is
/// `mean_density` everywhere, which the ramp would remove. The constant part of b − A x₀ is then
/// left out of each view, so that the specimen is as dense outside as inside.
Solution reconstruct_wbp(const VoxelProblem& problem, const WbpOptions& options,
                         double mean_density, const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
