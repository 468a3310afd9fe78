#include "align/trial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "align/aligning_fit.h"
#include "align/registration.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "measurement/held_out.h"
#include "measurement/prepare.h"

namespace tomofield::alignment {
namespace {

constexpr int kEvery = 8;
constexpr int kFineEpochs = 1;
constexpr int kCoarseBin = 2;  // of the last coarse stage

// Compares the errors of the views that have pixels to compare in both alignments.
Comparison compare_errors(const std::vector<double>& before, const std::vector<double>& after) {
  std::vector<double> gains;
  Comparison comparison;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (std::isnan(before[i]) || std::isnan(after[i])) continue;
    gains.push_back(before[i] - after[i]);
    comparison.before += before[i];
    comparison.after += after[i];
  }
  const auto n = static_cast<double>(std::max<std::size_t>(gains.size(), 1));
  comparison.before /= n;
  comparison.after /= n;
  comparison.gain = base::mean_gain(gains);
  return comparison;
}

}  // namespace

FitOptions held_out_fit(std::uint64_t seed) {
  return aligning_fit(kHeldOutCoarseEpochs, kFineEpochs, seed);
}

AlignmentTrial::AlignmentTrial(const JointProblem& problem,
                               std::vector<geometry::ViewCorrection> corrections,
                               const distributed::Communicator& processes)
    : problem_(problem),
      processes_(processes),
      corrections_(std::move(corrections)),
      field_(aligning_field(problem.field)) {}

const std::vector<double>& AlignmentTrial::coarse_errors() {
  if (coarse_errors_.empty()) begin();
  return coarse_errors_;
}

const std::vector<double>& AlignmentTrial::fine_errors() {
  if (coarse_errors_.empty()) begin();
  if (fine_errors_.empty()) go_on();
  return fine_errors_;
}

// Takes all coarse steps but the last ones, after which the pixels are fine.
void AlignmentTrial::begin() {
  const base::TraceSpan span("try alignment");
  measurement_ = aligning_measurement(problem_, corrections_, kCoarseBin, field_, processes_);
  measurement_.held_out = measurement::held_out_views(measurement_.geometry.tilt_deg, kEvery);
  fit_ = std::make_unique<fit::Fit>(measurement_, field_, held_out_fit(problem_.seed), processes_);
  run_with_wide_pixels(*fit_, kHeldOutCoarseEpochs, problem_, processes_);
  coarse_errors_ = errors();
}

void AlignmentTrial::go_on() {
  const base::TraceSpan span("try alignment with fine pixels");
  measurement::realign(problem_.recorded, corrections_, 1, problem_.scratch_dir,
                       fit::band_rows(field_), processes_, measurement_);
  fit_->reread_measurement();
  run_until(*fit_, fit_->num_steps(), problem_, processes_);
  fine_errors_ = errors();
  fit_.reset();
  measurement_.rays.reset();
}

std::vector<double> AlignmentTrial::errors() const {
  const std::vector<measurement::ViewModel> models(measurement_.held_out.size());
  const auto predicted = fit_->predict(measurement_.held_out, models);
  std::vector<double> errors(predicted.size());
  base::parallel_for("score held-out views", std::ssize(errors), [&](std::int64_t i) {
    const auto at = static_cast<std::size_t>(i);
    const Registration registration(image_pair(predicted[at], measurement_, fit_->stage()), {});
    const double variance = registration.measured_variance();
    errors[at] = variance > 0.0 ? registration.predicted_error({.shift = false}) / variance
                                : std::numeric_limits<double>::quiet_NaN();
  });
  return errors;
}

Comparison compare(AlignmentTrial& before, AlignmentTrial& after) {
  constexpr double kSure = 3.0;  // standard errors
  const Comparison coarse = compare_errors(before.coarse_errors(), after.coarse_errors());
  if (std::abs(coarse.gain.mean) > kSure * coarse.gain.error) return coarse;
  return compare_errors(before.fine_errors(), after.fine_errors());
}

}  // namespace tomofield::alignment
