#pragma once

#include <cstdint>
#include <vector>

#include "baseline/classical/ramp_filter.h"
#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

/// Returns the part of the half circle that each tilt stands for, in radians: half of the distances
/// to its neighbours in the order of tilts, where 180° is 0° again. Beyond the first and the last
/// tilt at most the mean spacing counts, so that no tilt stands for the missing wedge.
std::vector<double> tilt_weights(const std::vector<double>& tilt_deg);

/// Replaces the rays [x, lane] that do not count (mask [x], a bit a lane) by a straight line
/// between the nearest ones in their row that count. Rays at the end of a row, with none that
/// counts on one side, become 0.
void bridge_gaps(const std::uint16_t* mask, std::int64_t width, float* rays);

struct WbpOptions {
  RampFilterOptions filter;

  MethodFacts facts() const { return {"wbp", 1, 1, 1}; }
};

/// Reconstructs by weighted back-projection (Gilbert 1972; Kak and Slaney 1988, chapter 3):
///   x = x₀ + Σ_view Δθ_view / (h_x h_z) Aᵀ_view (ramp ∗ (b − A x₀))
/// with Δθ of tilt_weights(). bridge_gaps() fills rays that do not count. Neither the noise
/// of a view nor a fitted scale plays a part. Densities may be negative.
///
/// If the specimen ends inside the field of view (no margins), x₀ is 0. If it goes on, x₀ is
/// `mean_density` everywhere, which the ramp would remove. The constant part of b − A x₀ is then
/// left out of each view, so that the specimen is as dense outside as inside.
Solution reconstruct_wbp(const VoxelProblem& problem, const WbpOptions& options,
                         double mean_density, const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
