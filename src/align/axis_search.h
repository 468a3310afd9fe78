#pragma once

#include <vector>

#include "align/joint_alignment.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Number of fits that with_best_axis() makes, at most.
inline constexpr int kMostAxisFits = 13;

/// Returns the corrections with the common rotation about the centres of the views at which the
/// views agree best with a field that is fitted and aligned with coarse pixels. It looks for the
/// rotation within ±6°. Every process calls it and gets the same.
///
/// The joint alignment finds the direction of the tilt axis as well, but slowly, because a field
/// that was fitted with a wrong axis agrees with it.
std::vector<geometry::ViewCorrection> with_best_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes);

}  // namespace tomofield::align
