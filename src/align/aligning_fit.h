#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "align/joint_alignment.h"
#include "align/local/local_registration.h"
#include "align/registration.h"
#include "distributed/communicator.h"
#include "fit/fit.h"
#include "fit/stages.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"
#include "tomofield/options.h"

namespace tomofield::alignment {

/// Returns the options of a field of plain vertices that serves to align views, like the field of a
/// reconstruction in all else.
FieldOptions aligning_field(FieldOptions field);

/// Returns the options of a fit that serves to align views. The field is stiff, because a soft one
/// blurs until it explains wrong shifts.
FitOptions aligning_fit(int coarse_epochs, int fine_epochs, std::uint64_t seed);

/// Throws base::StopRequested in every process if any of them was asked to stop.
void check_stop(const JointProblem& problem, const distributed::Communicator& processes);

/// Takes the steps of a fit up to one of them. Throws base::StopRequested after an epoch if a stop
/// was requested. Every process calls it.
void run_until(fit::Fit& fit, std::int64_t last_step, const JointProblem& problem,
               const distributed::Communicator& processes);

/// Does the same up to where the fit can stop last before the pixels are fine
/// (Fit::last_stop_before()). So many epochs of it have wide pixels.
void run_with_wide_pixels(fit::Fit& fit, int coarse_epochs, const JointProblem& problem,
                          const distributed::Communicator& processes);

/// Prepares the views of a problem, each aligned with a correction, for the stages of a fit whose
/// pixels are at least `bin` times as wide.
measurement::Measurement aligning_measurement(const JointProblem& problem,
                                              std::span<const geometry::ViewCorrection> corrections,
                                              int bin, const FieldOptions& field,
                                              const distributed::Communicator& processes);

/// Returns a view and its prediction by a fit in one of its stages, with their place in the aligned
/// view.
ImagePair image_pair(const measurement::PredictedView& view,
                     const measurement::Measurement& measurement, const fit::Stage& stage);

/// Returns the options of the registration of local motion in a stage.
LocalRegistrationOptions local_options(const measurement::Measurement& measurement,
                                       const fit::Stage& stage);

/// Returns the bytes that the predictions of for_each_prediction() and of predictions_by_tilt()
/// take at most.
std::size_t prediction_memory(const measurement::Measurement& measurement);

/// Predicts all views by a fit in one of its stages, as many at a time as fit into a gigabyte, and
/// calls visit(view, images) for each of them, from several threads. Every process calls it.
void for_each_prediction(const fit::Fit& fit, const measurement::Measurement& measurement,
                         const fit::Stage& stage,
                         const std::function<void(std::size_t, const ImagePair&)>& visit);

/// Returns the mean squared difference of each view and its prediction by a fit in one of its
/// stages, in the pixels that are not near an edge. Every process calls it and gets the same.
std::vector<double> inner_residuals(const fit::Fit& fit,
                                    const measurement::Measurement& measurement,
                                    const fit::Stage& stage);

/// A fit and the alignment of the views that it is made with.
struct FitInProgress {
  const JointProblem& problem;
  const FieldOptions& field;
  const std::vector<geometry::ViewCorrection>& corrections;
  const std::vector<double>& steps_px;  ///< root mean square of each update so far
  measurement::Measurement& measurement;
  fit::Fit& fit;
};

/// Takes the first `num_epochs` epochs of a fit. After those that show enough for it, calls
/// update(stage), which changes the corrections or returns false. After an update and for each new
/// stage, resamples the recorded views to the pixels of the stage, and the fit goes on with them.
/// Progress is reported if these are all epochs. Throws base::StopRequested after an epoch if a
/// stop was requested. Every process calls it.
void run_with_updates(const FitInProgress& run, std::int64_t num_epochs,
                      const std::function<bool(const fit::Stage&)>& update,
                      const distributed::Communicator& processes);

}  // namespace tomofield::alignment
