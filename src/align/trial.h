#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "align/joint_alignment.h"
#include "base/statistics.h"
#include "distributed/communicator.h"
#include "fit/fit.h"
#include "geometry/view_correction.h"
#include "measurement/measurement.h"
#include "tomofield/options.h"

namespace tomofield::alignment {

/// Returns the options of the fit of an AlignmentTrial.
FitOptions held_out_fit(std::uint64_t seed);

/// Number of epochs of that fit with wide pixels.
inline constexpr int kHeldOutCoarseEpochs = 24;

/// Fits a field to the views of an alignment without every eighth one in order of tilt, and says
/// how badly it predicts those: the mean squared difference of each, over the variance of the
/// measured pixels. Scale and trend are the best for the view itself, since no other view tells
/// them; they come from other pixels than the error. Throws base::StopRequested while it fits if a
/// stop was requested. Every process makes it and gets the same.
class AlignmentTrial {
 public:
  /// `problem` and `processes` must outlive the trial.
  AlignmentTrial(const JointProblem& problem, std::vector<geometry::ViewCorrection> corrections,
                 const distributed::Communicator& processes);

  /// Returns the errors in pixels twice as wide, after the coarse stages of the fit. That of a view
  /// without pixels to compare is not a number.
  const std::vector<double>& coarse_errors();
  /// Does the same in the pixels of the views, after the whole fit.
  const std::vector<double>& fine_errors();

 private:
  void begin();
  void go_on();
  std::vector<double> errors() const;

  const JointProblem& problem_;
  const distributed::Communicator& processes_;
  std::vector<geometry::ViewCorrection> corrections_;
  FieldOptions field_;
  measurement::Measurement measurement_;
  std::unique_ptr<fit::Fit> fit_;
  std::vector<double> coarse_errors_, fine_errors_;
};

/// Compares the errors of held-out views with two alignments.
struct Comparison {
  double before = 0.0, after = 0.0;  ///< mean errors of the views that have one
  base::MeanGain gain;               ///< of the differences over the views
};

/// Compares two alignments by their errors in wide pixels if these differ by more than three
/// standard errors, else by those in the pixels of the views.
Comparison compare(AlignmentTrial& before, AlignmentTrial& after);

}  // namespace tomofield::alignment
