#pragma once

#include <vector>

#include "fit/stages.h"
#include "measurement/measurement.h"
#include "tomofield/options.h"

namespace tomofield::plan {

/// The processor time of a step of a stage.
struct StepTime {
  double fixed_seconds = 0, seconds_a_sample = 0;
};

/// The processor time of the steps of a fit, by the kind of its field.
struct StepTimes {
  StepTime vertices, factors;
};

/// Returns the samples of all slabs of a stage of a fit to `plan`, on at most `max_rows` rows.
double samples_of(const fit::Stage& stage, const measurement::Measurement& plan,
                  const FieldOptions& field, double max_rows);

/// Measures the steps of a fit in a small volume, of noise, with the views and the stages of
/// `plan`, which has no rays and is not of raw views. Takes a fraction of a second.
StepTimes measure_steps(const measurement::Measurement& plan, const FieldOptions& field,
                        const FitOptions& fit);

}  // namespace tomofield::plan
