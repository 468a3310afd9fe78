#pragma once

#include <optional>
#include <vector>

#include "align/joint_alignment.h"
#include "align/mean_gain.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Compares the errors of held-out views (trial.h) with two alignments.
struct Comparison {
  double before = 0.0, after = 0.0;  ///< mean errors
  MeanGain gain;                     ///< of the differences over the views
};

/// Holds the local motion of a series and what speaks for it.
struct LocalTrial {
  Comparison held_out;
  std::vector<double> steps_px;  ///< LocalAlignment::steps_px
  bool is_accepted = false;
};

/// Holds the alignment of a series and what speaks for it.
struct Alignment {
  std::vector<geometry::ViewCorrection> corrections;  ///< [view]; none if it was not accepted
  JointAlignment joint;
  Comparison held_out;  ///< with the alignment that the files give and with the new one
  bool is_accepted = false;
  std::optional<LocalTrial> local;  ///< none if the views show no local motion
  std::vector<int> unaligned;       ///< views that do not resemble their projections, ascending
};

/// Finds shifts of a few pixels' accuracy by cross-correlation of small images of the views
/// (correlation_start.h), for a series that is not aligned but for the direction of its tilt axis.
std::vector<geometry::ViewCorrection> correlated_start(const JointProblem& problem);

/// Aligns a series further, from `start`. The new alignment is accepted if a field that is
/// fitted with it predicts held-out views better, by more than the standard error over the views.
/// If the views then show local motion (JointAlignment::motion), it is looked for, and it is
/// accepted if held-out views are predicted better by more than two standard errors. Every process
/// calls it and gets the same.
Alignment refine_alignment(const JointProblem& problem, std::vector<geometry::ViewCorrection> start,
                           const distributed::Communicator& processes);

}  // namespace tomofield::align
