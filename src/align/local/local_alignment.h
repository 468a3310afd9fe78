#pragma once

#include <span>
#include <vector>

#include "align/joint_alignment.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// The result of a local alignment: motion that the given corrections lack.
struct LocalAlignment {
  std::vector<geometry::ViewCorrection> corrections;  ///< [view]; each has local motion
  std::vector<ViewAgreement> agreement;               ///< [view]
  /// Root mean square of the change of the local motion in each update, in pixels before binning.
  std::vector<double> steps_px;
};

/// Finds the local motion of the views as align_jointly() finds their shifts: a field is fitted
/// from coarse to fine, and the motion that each view shows against its prediction
/// (local_registration.h) is undone while the fit goes on. What is rigid of it goes to the shifts,
/// and to rotations and magnifications if `freedoms` has them. Every correction of `start` must
/// have local motion to begin with. Throws base::StopRequested if a stop was requested. Every
/// process calls it and gets the same.
LocalAlignment align_locally(const JointProblem& problem, const Freedoms& freedoms,
                             std::vector<geometry::ViewCorrection> start,
                             std::span<const geometry::ViewWarp> motion,
                             const distributed::Communicator& processes);

}  // namespace tomofield::alignment
