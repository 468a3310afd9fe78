#pragma once

#include <vector>

#include "align/joint_alignment.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// Number of fits that with_best_axis() makes, at most.
inline constexpr int kMostAxisFits = 10;

/// Returns the corrections with the common rotation about the centres of the views at which the
/// views agree best with a field that is fitted and aligned with coarse pixels. It goes from 0 to
/// where they agree better, at most 8° away, as far as the views are sure of the slope (three
/// standard errors). Reports its progress. Throws base::StopRequested if a stop was requested.
/// Every process calls it and gets the same.
///
/// The joint alignment finds the direction of the tilt axis as well, but slowly, because a field
/// that was fitted with a wrong axis agrees with it.
std::vector<geometry::ViewCorrection> with_best_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes);

/// Number of epochs of each fit of with_refined_axis(), and the usual number of these fits.
inline constexpr int kAxisEpochs = 16, kAxisFits = 3;

/// Returns true if the views of a series are large enough for with_refined_axis(). In smaller ones,
/// other slow errors of an alignment hide the direction of the axis.
bool can_refine_axis(const measurement::Measurement& plan);

/// Returns the options of the fits of with_refined_axis().
FitOptions axis_fit(std::uint64_t seed);

/// Returns the corrections of a joint alignment with the common rotation at which fields that are
/// fitted to the views leave the smallest residual. Pixels near the edges do not count, and neither
/// do steps and bends of residuals below two standard errors over the views. Returns `start` if the
/// views are too small (can_refine_axis()). Reports its progress. Throws base::StopRequested if a
/// stop was requested. Every process calls it and gets the same.
///
/// The registrations of a joint alignment see only a small part of an error of the axis: a fortieth
/// in a specimen that ends in the views, and a hundred and fiftieth in one that fills them
/// (docs/results/alignment.md). The residual tells it better.
std::vector<geometry::ViewCorrection> with_refined_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes);

}  // namespace tomofield::alignment
