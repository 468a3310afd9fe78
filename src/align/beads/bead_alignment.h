#pragma once

#include <optional>
#include <span>
#include <vector>

#include "align/freedoms.h"
#include "align/joint_alignment.h"
#include "base/statistics.h"
#include "distributed/communicator.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// The spot of a bead in a view that is aligned with corrections, relative to its centre. All
/// lengths here are in pixels of the fit, but for those that align_by_beads() returns.
struct BeadPoint {
  std::size_t view = 0;
  double x_px = 0.0, y_px = 0.0;
};

/// The tilts and the tilt axis by which the views see the beads.
struct BeadGeometry {
  std::vector<double> tilt_deg;
  double axis_px = 0.0;  ///< x of the tilt axis, relative to the centre
};

/// The steps of an alignment that gold beads ask for, and how far the beads lie from their places.
struct BeadAlignment {
  std::vector<geometry::ViewCorrection> steps;  ///< [view], follow the given corrections
  bool is_accepted = false;                     ///< whether they pay
  std::size_t num_beads = 0;
  /// Root mean square distance in x and in y of spots from where their bead should be: with the
  /// alignment of the files, with the corrections that were given, and after the steps. Outliers
  /// count less.
  double files_px = 0.0, before_px = 0.0, after_px = 0.0;
  /// The part by which the squared distances fall, over beads that do not decide about the steps.
  base::MeanGain gain;
};

/// Finds the steps after `corrections` with which each bead keeps its place in the specimen best:
/// in a view of tilt θ it is at x = axis + X cos θ + Z sin θ, y = Y. The direction of the tilt
/// axis, rotations, shifts and, if they are free, magnifications may change, slowly over the tilts:
/// each is a sum of a few cosines of the view's rank in order of tilt. Priors say how large the
/// errors of a joint alignment are, so that few or poor beads change little. The steps are accepted
/// if beads that do not decide about them lie nearer to their places, by more than one standard
/// error over the beads. Returns nothing for fewer than three beads. There must be at least six
/// views, and four spots of each bead.
///
/// A field that blurs a little explains slow errors of an alignment (slow_modes.h); a bead cannot
/// blur. What changes from view to view is left to the field, which sees far more of a view than a
/// few beads.
std::optional<BeadAlignment> fit_beads(std::span<const std::vector<BeadPoint>> beads,
                                       std::span<const geometry::ViewCorrection> corrections,
                                       const BeadGeometry& geometry, const Freedoms& freedoms);

/// Looks for gold beads in the recorded views, aligned with corrections, and fits them. Lengths of
/// the corrections and of the result are in pixels before binning. Returns nothing if there are
/// none. Every process calls it and gets the same.
std::optional<BeadAlignment> align_by_beads(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& corrections,
    const Freedoms& freedoms, const distributed::Communicator& processes);

}  // namespace tomofield::alignment
