#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "align/joint_alignment.h"
#include "align/local_registration.h"
#include "align/registration.h"
#include "distributed/communicator.h"
#include "fit/fit.h"
#include "fit/options.h"
#include "fit/stages.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"

namespace tomofield::align {

/// Returns the options of a field of plain vertices that serves to align views, like the field of a
/// reconstruction in all else.
fit::FieldOptions aligning_field(fit::FieldOptions field);

/// Returns the options of a fit that serves to align views. The field is stiff, because a soft one
/// blurs until it explains wrong shifts.
fit::FitOptions aligning_fit(int coarse_epochs, int fine_epochs, std::uint64_t seed);

/// Prepares the views of a problem, each aligned with a correction.
measurement::Measurement aligning_measurement(const JointProblem& problem,
                                              std::span<const geometry::ViewCorrection> corrections,
                                              const fit::FieldOptions& field,
                                              const distributed::Communicator& processes);

/// Returns a view and its prediction by a fit in one of its stages, with their place in the aligned
/// view.
ImagePair image_pair(const measurement::PredictedView& view,
                     const measurement::Measurement& measurement, const fit::Stage& stage);

/// Says how local motion is registered in a stage.
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

/// Says what run_with_updates() does with a fit.
struct UpdateSteps {
  /// Updates the alignment after an epoch of a stage. Returns false if it leaves it as it is.
  std::function<bool(const fit::Stage&)> update;
  /// Lets the fit go on with the views of the present alignment.
  std::function<void()> resample;
};

/// Takes the first `num_epochs` epochs of a fit. Updates the alignment after those that show enough
/// for it, and resamples the views after an update and for each new stage. Progress, with the last
/// of `steps_px`, is reported if these are all epochs. Returns true if a stop was requested
/// meanwhile. Every process calls it.
bool run_with_updates(const JointProblem& problem, fit::Fit& fit, std::int64_t num_epochs,
                      const std::vector<double>& steps_px, const UpdateSteps& steps,
                      const distributed::Communicator& processes);

/// Resamples the views of a fit with other corrections, from the recorded ones to the pixels of the
/// fit's stage, and lets the fit go on with them; does nothing if the fit is done. Every process
/// calls it.
void go_on_with(const JointProblem& problem, std::span<const geometry::ViewCorrection> corrections,
                const fit::FieldOptions& field, const distributed::Communicator& processes,
                measurement::Measurement& measurement, fit::Fit& fit);

}  // namespace tomofield::align
