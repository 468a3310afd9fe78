#include "verdict/judge.h"

#include <algorithm>
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
  verdict.warnings = find_warnings(verdict, {.contrast = finished.options.views.contrast,
                                             .alignment = finished.alignment,
                                             .tilt_deg = series.geometry.tilt_deg,
                                             .thickness = series.geometry.thickness,
                                             .bin_factor = series.bin_factor,
                                             .aligned_before = finished.options.run.align});
  return verdict;
}

}  // namespace tomofield::verdict
