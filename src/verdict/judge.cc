#include "verdict/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/statistics.h"
#include "base/system/memory.h"
#include "verdict/warnings.h"

namespace tomofield::verdict {
namespace {

HeldOutSummary summary_of(const std::vector<double>& errors, const std::vector<int>& views,
                          const std::vector<double>& tilt_deg) {
  const auto worst = std::ranges::max_element(errors);
  const int view = views[static_cast<std::size_t>(worst - errors.begin())];
  return {.median = base::median({errors.begin(), errors.end()}),
          .worst = *worst,
          .worst_tilt_deg = tilt_deg[static_cast<std::size_t>(view)]};
}

// Returns the errors of the fit's own held-out views, or else those of the chosen trial.
std::optional<HeldOutSummary> held_out_summary(
    const FinishedFit& finished, const std::optional<measurement::ViewErrors>& held_out) {
  const std::vector<double>& tilt_deg = finished.series.geometry.tilt_deg;
  if (held_out) return summary_of(held_out->view_error, held_out->views, tilt_deg);
  const std::optional<tune::TunedFit>& tuned = finished.tuned;
  if (!tuned) return std::nullopt;
  const tune::FitTrial* const chosen = tune::chosen_trial(*tuned);
  if (chosen == nullptr || chosen->score.view_error.empty()) return std::nullopt;
  HeldOutSummary summary = summary_of(chosen->score.view_error, tuned->predicted_views, tilt_deg);
  summary.is_of_trials = true;
  return summary;
}

PriorSummary prior_summary(const FinishedFit& finished) {
  PriorSummary summary{.is_used = finished.fit.stage().has_answer, .gain = {}};
  const std::optional<tune::TunedFit>& tuned = finished.tuned;
  if (tuned) summary.gain = tune::gain_of_prior(*tuned);
  return summary;
}

// Returns the options of which no series needs such a value: GivenInput::extreme_settings.
std::vector<std::string> extreme_settings(const options::ReconstructOptions& options) {
  constexpr double kTimes = 7;  // weights beyond the usual one
  constexpr double kMostFactorVariation = 100, kMostFourier = 1e4, kMostSpacing = 4;
  constexpr double kLeastRate = 0.005, kMostRate = 0.5;
  const FitOptions& fit = options.fit;
  const double rate = fit.learning_rate.value();
  std::vector<std::string> found;
  const auto add = [&](bool is_extreme, const char* option, double value) {
    if (is_extreme) found.push_back(fmt::format("{} {:g}", option, value));
  };
  const double variation = fit.density_variation.value();
  add(variation > kTimes * FitOptions{}.density_variation.value(), "--tv", variation);
  add(fit.factor_variation > kMostFactorVariation, "--tv-factors", fit.factor_variation);
  add(fit.fourier > kMostFourier, "--ifp", fit.fourier);
  add(options.field.vertex_spacing > kMostSpacing, "--vertex-spacing",
      options.field.vertex_spacing);
  add(rate < kLeastRate || rate > kMostRate, "--learning-rate", rate);
  return found;
}

}  // namespace

Verdict judge(const FinishedFit& finished, const std::optional<measurement::ViewErrors>& held_out) {
  const fit::Fit& fit = finished.fit;
  const measurement::Measurement& series = finished.series;
  const distributed::Communicator& processes = fit.processes();
  Verdict verdict;
  const std::vector<double>& residuals = fit.progress().data_loss;
  if (!residuals.empty()) verdict.residual = residuals.back();
  verdict.held_out = held_out_summary(finished, held_out);
  verdict.prior = prior_summary(finished);
  verdict.artefacts = evaluate::find_artefacts(fit.field(), series.roi, finished.rows, processes);
  verdict.sections = section_profile(verdict.artefacts.section_deviation);
  if (!series.ray_geometry)
    verdict.views = compare_views(fit, series, finished.options.field.with_margin);
  if (!series.ray_geometry) verdict.defocus = check_defocus(fit, series);
  verdict.seconds = finished.options.since_start.seconds();
  verdict.peak_GiB = processes.allreduce_max(static_cast<double>(base::peak_memory())) / (1 << 30);
  verdict.warnings =
      find_warnings(verdict, {.contrast = finished.options.views.contrast,
                              .alignment = finished.alignment,
                              .tilt_deg = series.geometry.tilt_deg,
                              .residual = fit.progress().view_residual,
                              .thickness = series.geometry.thickness,
                              .bin_factor = series.bin_factor,
                              .aligned_before = finished.options.run.align,
                              .extreme_settings = extreme_settings(finished.options)});
  return verdict;
}

}  // namespace tomofield::verdict
