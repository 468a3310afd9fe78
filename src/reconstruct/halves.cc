#include "reconstruct/halves.h"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/trace.h"
#include "checkpoint/checkpoint.h"
#include "fit/domain.h"
#include "io/saving/scratch_memory.h"
#include "reconstruct/half_results.h"
#include "reconstruct/results.h"
#include "reconstruct/run_fit.h"

namespace tomofield::reconstruction {
namespace {

using tilt_series::Half;

// The part of a run's work that one of its fits is, as fractions of all views that are fitted.
struct ProgressShare {
  double begin = 0.0, size = 1.0;
};

// Describes one of the fits of a run.
struct Part {
  std::string name;
  const measurement::Measurement& measurement;
  const std::filesystem::path& model;
  std::vector<measurement::ViewModel> kept_views;  // empty: the fit finds its own
  ProgressShare share;
  // Halves are compared to see what the data say, so that no prior may add the same to both.
  bool may_learn = false;
};

// Holds what a finished fit leaves.
struct FinishedPart {
  record::FitRecord findings;
  std::vector<measurement::ViewModel> views;
  std::optional<measurement::PredictedView> held_out_view;
  bool took_steps = false;
};

// Makes a fit, examines it, and saves its model. Returns nothing if a stop was requested; there is
// a checkpoint then.
std::optional<FinishedPart> fit_part(const Run& run, const std::optional<tune::TunedFit>& tuned,
                                     const Part& part, bool resumes) {
  const bool lacks_prior = !part.may_learn && run.options.fit.prior != Prior::kTv;
  base::log_info(fmt::format(
      "{}: {} views{}", part.name, part.measurement.num_fitted_views(),
      lacks_prior ? ", without the learned prior, which would add the same to both halves" : ""));
  FitOutcome outcome{
      {checkpoint::fingerprint_of(run.options, part.measurement, run.processes), tuned}};
  const base::ProgressSink progress =
      base::part_of(run.observer.fit, part.share.begin, part.share.size, part.name);
  const FitRun made = run_fit(run, {.measurement = part.measurement,
                                    .model = part.model,
                                    .origin = outcome.origin,
                                    .resumes = resumes,
                                    .progress = progress,
                                    .kept_views = part.kept_views,
                                    .may_learn = part.may_learn});
  if (made.was_stopped) return std::nullopt;
  outcome.seconds = made.seconds;
  made.fit->free_optimizer();  // the verdict needs the memory
  FinishedPart finished{.findings = examine(*made.fit, part.measurement, run, outcome),
                        .views = made.fit->progress().views,
                        .held_out_view = {},
                        .took_steps = made.took_steps};
  finished.held_out_view = central_held_out_view(*made.fit, part.measurement, finished.findings);
  checkpoint::save_fit(part.model, *made.fit, checkpoint::model_info(part.measurement, run.options),
                       checkpoint::progress_state(*made.fit, outcome.origin));
  return finished;
}

// Removes the model of a half that an earlier run left: it is to be replaced, and a resumed run
// must not take it for a checkpoint of this one.
void forget_old_model(const Run& run, Half half) {
  std::error_code ignored;
  if (run.processes.is_root())
    std::filesystem::remove(run.paths.halves[static_cast<std::size_t>(half)].model, ignored);
}

}  // namespace

measurement::Measurement half_measurement(tilt_series::Half half, const Run& run) {
  const base::TraceSpan span("prepare half");
  if (run.options.fit.split_tilts) return measurement::half_of_tilts(half, run.measurement);
  return measurement::half_of_frames(run.series, half, run.measurement,
                                     io::scratch_directory(run.options.run.output),
                                     fit::band_rows(run.options.field), run.processes);
}

std::vector<measurement::ViewModel> views_of_half(const std::vector<measurement::ViewModel>& views,
                                                  const Run& run) {
  if (run.options.fit.split_tilts) return views;
  return measurement::with_noise_of_half_frames(views);
}

RunResult reconstruct_halves(const Run& run, const std::optional<tune::TunedFit>& tuned) {
  bool resumes = run.options.run.resume;
  // A half of the tilts has half of the views, and a half of the frames has all of them.
  const double of_half = run.options.fit.split_tilts ? 1.0 / 4 : 1.0 / 3;
  std::optional<FinishedPart> whole = fit_part(run, tuned,
                                               {.name = "all data",
                                                .measurement = run.measurement,
                                                .model = run.paths.model,
                                                .kept_views = {},
                                                .share = {0.0, 1 - 2 * of_half},
                                                .may_learn = true},
                                               resumes);
  if (!whole) return {.outcome = Outcome::kStopped, .checkpoint = run.paths.model};
  resumes = resumes && !whole->took_steps;
  FinishedFits finished{.whole = std::move(whole->findings),
                        .held_out_view = std::move(whole->held_out_view),
                        .halves = {}};
  for (const Half half : tilt_series::kBothHalves) {
    if (!resumes) forget_old_model(run, half);
    const auto at = static_cast<std::size_t>(half);
    const measurement::Measurement measured = half_measurement(half, run);
    const std::filesystem::path& model = run.paths.halves[at].model;
    std::optional<FinishedPart> made =
        fit_part(run, tuned,
                 {.name = fmt::format("{} half", name_of(half)),
                  .measurement = measured,
                  .model = model,
                  .kept_views = views_of_half(whole->views, run),
                  .share = {1 - of_half * static_cast<double>(2 - at), of_half}},
                 resumes);
    if (!made) return {.outcome = Outcome::kStopped, .checkpoint = model};
    resumes = resumes && !made->took_steps;
    finished.halves[at] = std::move(made->findings);
  }
  return write_half_results(run, finished, tuned);
}

}  // namespace tomofield::reconstruction
