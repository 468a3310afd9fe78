#include "reconstruct/halves.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "base/log.h"
#include "base/trace.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/half_measurement.h"
#include "reconstruct/half_results.h"
#include "reconstruct/results.h"
#include "reconstruct/run_fit.h"
#include "reconstruct/shared_views.h"

namespace tomofield::reconstruction {
namespace {

using tilt_series::Half;

// Puts the progress of one of two fits into that of both.
base::ProgressSink progress_of_half(const base::ProgressSink& both, Half half) {
  if (!both) return {};
  return [&both, half](base::ProgressReport report) {
    const bool is_first = half == tilt_series::kBothHalves.front();
    if (is_first) report.seconds_left += report.seconds_elapsed + report.seconds_left;
    report.fraction_done = (report.fraction_done + (is_first ? 0 : 1)) / 2;
    report.detail = fmt::format("{} half  {}", name_of(half), report.detail);
    both(report);
  };
}

// Removes a model that an earlier run left: it is to be replaced, and a resumed run must not take
// it for a checkpoint of this one.
void forget_old_model(const Run& run, Half half) {
  std::error_code ignored;
  if (run.processes.is_root())
    std::filesystem::remove(run.paths.halves[static_cast<std::size_t>(half)].model, ignored);
}

}  // namespace

RunResult reconstruct_halves(const tilt_series::TiltSeries& series, const Run& run,
                             const RunRecord& record, const std::optional<TunedFit>& tuned) {
  const auto shared_views = find_shared_views(run);
  if (!shared_views) return {.outcome = Outcome::kStoppedTuning};
  FinishedHalves finished;
  bool resumes = run.options.resolved.resume;
  for (const Half half : tilt_series::kBothHalves) {
    const auto at = static_cast<std::size_t>(half);
    const measurement::Measurement measured = half_measurement(series, half, run);
    base::log_info(fmt::format("{} half of the {}: {} views", name_of(half),
                               run.options.files.even ? "frames" : "tilts",
                               measured.num_fitted_views()));
    RunRecord record_of_half = record;
    record_of_half.origin = {fingerprint_of(run.options, measured, run.processes), tuned};
    const base::ProgressSink progress = progress_of_half(run.hooks.progress, half);
    const std::filesystem::path& model = run.paths.halves[at].model;
    const FitRun made = run_fit(run, {.measurement = measured,
                                      .model = model,
                                      .origin = record_of_half.origin,
                                      .resumes = resumes,
                                      .progress = progress,
                                      .kept_views = views_of_half(*shared_views, run)});
    if (made.was_stopped) return {.outcome = Outcome::kStopped, .checkpoint = model};
    record_of_half.fit_seconds = made.seconds;
    finished[at] = examine(*made.fit, measured, run.options, record_of_half);
    save_fit(model, *made.fit, model_info(measured, run.options),
             progress_state(*made.fit, record_of_half.origin));
    if (made.took_steps && half == Half::kEven) {
      resumes = false;
      forget_old_model(run, Half::kOdd);
    }
  }
  return {.outcome = Outcome::kFinished,
          .results = write_half_results(series, run, finished, tuned)};
}

}  // namespace tomofield::reconstruction
