#include "align/trial.h"

#include "align/aligning_fit.h"
#include "align/registration.h"
#include "base/parallel.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "measurement/held_out.h"

namespace tomofield::align {
namespace {

constexpr int kEvery = 8;

}  // namespace

fit::FitOptions held_out_fit(std::uint64_t seed) {
  constexpr int kCoarseEpochs = 24, kFineEpochs = 1;
  return aligning_fit(kCoarseEpochs, kFineEpochs, seed);
}

std::vector<double> errors_of_held_out_views(const JointProblem& problem,
                                             std::span<const geometry::ViewCorrection> corrections,
                                             const distributed::Communicator& processes) {
  const base::TraceSpan span("try alignment");
  const fit::FieldOptions field = aligning_field(problem.field);
  measurement::Measurement measurement =
      aligning_measurement(problem, corrections, field, processes);
  measurement.held_out = measurement::held_out_views(measurement.geometry.tilt_deg, kEvery);
  fit::Fit fit(measurement, field, held_out_fit(problem.seed), processes);
  fit.run([](const fit::Fit&) { return true; });
  const std::vector<measurement::ViewModel> models(measurement.held_out.size());
  const auto predicted = fit.predict(measurement.held_out, models);
  std::vector<double> errors(predicted.size());
  base::parallel_for("score held-out views", std::ssize(errors), [&](std::int64_t i) {
    const auto at = static_cast<std::size_t>(i);
    const Registration registration(image_pair(predicted[at], measurement, fit.stage()), {});
    errors[at] = registration.predicted_error({.shift = false}) / registration.measured_variance();
  });
  return errors;
}

}  // namespace tomofield::align
