#pragma once

#include <vector>

#include "align/joint_alignment.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Holds the alignment of a series and what speaks for it.
struct Alignment {
  std::vector<geometry::ViewCorrection> corrections;  ///< [view]; none if it was not accepted
  JointAlignment joint;
  /// Mean error of held-out views (trial.h) with the alignment that the files give and with the new
  /// one.
  double error_before = 0.0, error_after = 0.0;
  /// Mean of their differences over the views, and its standard error.
  double gain = 0.0, gain_error = 0.0;
  bool is_accepted = false;
  std::vector<int> unaligned;  ///< views that do not resemble their projections, ascending
};

/// Finds shifts of a few pixels' accuracy by cross-correlation of small images of the views
/// (correlation_start.h), for a series that is not aligned but for the direction of its tilt axis.
std::vector<geometry::ViewCorrection> correlated_start(const JointProblem& problem);

/// Aligns a series further, from `start`. The new alignment is accepted if a field that is
/// fitted with it predicts held-out views better, by more than the standard error over the views.
/// Every process calls it and gets the same.
Alignment refine_alignment(const JointProblem& problem, std::vector<geometry::ViewCorrection> start,
                           const distributed::Communicator& processes);

}  // namespace tomofield::align
