#pragma once

#include <span>
#include <vector>

#include "align/joint_alignment.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Returns the options of the fit of errors_of_held_out_views().
fit::FitOptions held_out_fit(std::uint64_t seed);

/// Fits a field to the views of an alignment without every eighth one in order of tilt, and returns
/// how badly it predicts those: the mean squared difference of each, over the variance of the
/// measured pixels. Scale and trend are the best for the view itself, since no other view tells
/// them; they come from other pixels than the error. Every process calls it.
std::vector<double> errors_of_held_out_views(const JointProblem& problem,
                                             std::span<const geometry::ViewCorrection> corrections,
                                             const distributed::Communicator& processes);

}  // namespace tomofield::align
