#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "io/scratch_memory.h"
#include "measurement/background.h"
#include "measurement/held_out.h"
#include "measurement/undecided_beads.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/results.h"
#include "reconstruct/tuning.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

// Holds what the steps of a run share.
struct Run {
  const ReconstructHooks& hooks;
  const distributed::Communicator& processes;
  ReconstructOptions options;
  OutputPaths paths;
  measurement::Measurement measurement;

  bool writes_files() const { return !options.resolved.output.empty(); }
};

// Prepares the views and holds some of them out, as the options say.
measurement::Measurement prepare(const tilt_series::TiltSeries& series,
                                 const ReconstructOptions& options,
                                 const distributed::Communicator& processes) {
  const base::TraceSpan span("prepare rays");
  measurement::Measurement measurement = measurement::prepare_measurement(
      series, options.specimen, io::scratch_directory(options.resolved.output),
      fit::band_rows(options.field), processes);
  measurement.held_out =
      measurement::held_out_views(measurement.geometry.tilt_deg, options.fit.hold_out);
  return measurement;
}

// Calls a function that reads the checkpoint. If it throws, adds what the user can do.
void read_checkpoint(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    throw Error(fmt::format(
        "cannot resume: {}; to start over, give --overwrite instead of --resume", error.what()));
  }
}

// Makes the trials and chooses settings by them. Returns nothing if a stop was requested.
std::optional<TunedFit> choose_by_trials(const Run& run, const OpenSettings& open) {
  const ReconstructOptions& options = run.options;
  const TuneHooks hooks{.progress = run.hooks.tune_progress,
                        .stop_requested = run.hooks.stop_requested};
  if (!options.resolved.tune)
    return choose_by_short_trials(run.measurement, options.field, options.fit, open, hooks,
                                  run.processes);
  const std::string fingerprint = fingerprint_of(options, run.measurement, run.processes);
  const std::filesystem::path path = run.writes_files() ? run.paths.trials : "";
  std::optional<selection::TrialFile> file;
  run.processes.run_collectively([&] { file.emplace(path, fingerprint, options.resolved.resume); });
  return tune(run.measurement, options.field, options.fit, open, *file, hooks, run.processes);
}

// Takes over what was chosen, and corrects the views as it says.
void apply(const TrialSettings& settings, Run& run) {
  ReconstructOptions& options = run.options;
  Options& resolved = options.resolved;
  if (options.open.variation) resolved.penalty = options.fit.penalty = settings.penalty;
  if (options.open.variation || resolved.tune)
    resolved.density_variation = options.fit.density_variation = settings.variation;
  if (resolved.tune) {
    resolved.epochs = options.fit.epochs = settings.epochs;
    resolved.rank = options.field.rank = settings.rank;
  }
  if (options.open.view_scale)
    resolved.fit_view_scale = options.fit.fit_view_scale = settings.fits_view_scale;
  if (run.options.open.background) {
    resolved.black_level =
        settings.background_part * run.measurement.background * run.measurement.unit;
    measurement::subtract_background(settings.background_part, run.measurement);
  }
  if (!run.measurement.undecided_beads.empty())
    resolved.bead_diameter_nm =
        settings.masks_beads ? run.measurement.masks.bead_diameter_A / 10 : 0.0;
  if (settings.masks_beads) measurement::hide_beads(run.measurement, run.processes);
}

// Chooses the settings that are left to trials. A resumed run takes those that its checkpoint has.
// Returns false if a stop was requested.
bool choose_settings(Run& run, std::optional<TunedFit>& tuned) {
  const base::TraceSpan span("choose settings");
  const OpenSettings open = open_settings(run.options.open, run.measurement);
  const bool makes_trials = run.options.num_trials(run.measurement.num_fitted_views(), open) > 0;
  if (makes_trials && run.options.resolved.resume && std::filesystem::exists(run.paths.model)) {
    run.processes.run_collectively(
        [&] { read_checkpoint([&] { tuned = stored_choice(run.paths.model); }); });
  } else if (makes_trials) {
    tuned = choose_by_trials(run, open);
    if (!tuned) return false;
  }
  if (tuned) apply(tuned->settings, run);
  measurement::keep_beads(run.measurement);
  return true;
}

// Returns what the fit is made from. All processes call it.
FitOrigin origin_of(const Run& run, std::optional<TunedFit> tuned) {
  const base::TraceSpan span("fingerprint");
  return {.fingerprint = fingerprint_of(run.options, run.measurement, run.processes),
          .tuned = std::move(tuned)};
}

// Returns where each view comes from in the stack.
std::vector<geometry::RawFromAligned> alignment_of(const tilt_series::TiltSeries& series) {
  std::vector<geometry::RawFromAligned> alignment;
  for (std::size_t view = 0; view < series.views().size(); ++view)
    alignment.push_back(series.raw_from_aligned(view));
  return alignment;
}

std::unique_ptr<fit::Fit> begin_fit(const Run& run) {
  const base::TraceSpan span("begin fit");
  return std::make_unique<fit::Fit>(run.measurement, run.options.field, run.options.fit,
                                    run.processes);
}

// Continues from the checkpoint, if there is one yet.
void resume(const Run& run, const FitOrigin& origin, fit::Fit& fit) {
  const base::TraceSpan span("read checkpoint");
  const std::filesystem::path& path = run.paths.model;
  if (!std::filesystem::exists(path)) {
    base::log_info(fmt::format("no checkpoint {} yet: starting from the beginning", path.string()));
    return;
  }
  read_checkpoint([&] { restore_fit(path, origin.fingerprint, fit); });
  base::log_info(fmt::format("resuming {} at step {} of {}", path.string(), fit.progress().step,
                             fit.num_steps()));
}

base::ProgressReport progress_report(const fit::Fit& fit, std::int64_t first_step,
                                     const base::Stopwatch& running) {
  base::ProgressReport report;
  const std::int64_t step = fit.progress().step;
  const double done = fit.work(step), all = fit.work(fit.num_steps());
  report.fraction_done = done / all;
  report.seconds_elapsed = running.seconds();
  report.seconds_left = (all - done) / (done - fit.work(first_step)) * report.seconds_elapsed;
  const double rate = static_cast<double>(step - first_step) / report.seconds_elapsed;
  const auto& loss = fit.progress().data_loss;
  const std::int64_t epoch = (step - 1) / fit.steps_per_epoch() + 1;
  const auto& held_out = fit.progress().held_out_error;
  report.detail =
      fmt::format("epoch {}/{}  loss {}{}  {:.1f} steps/s", epoch, fit.num_epochs(),
                  loss.empty() ? "-" : fmt::format("{:.4f}", loss.back()),
                  held_out.empty() ? "" : fmt::format("  held out {:.4f}", held_out.back()), rate);
  return report;
}

// Runs the fit and saves checkpoints when they are due, if the run writes files. Returns false if
// it was stopped; there is a checkpoint then.
bool run_with_checkpoints(const Run& run, const FitOrigin& origin, fit::Fit& fit) {
  const base::TraceSpan span("fit");
  const double seconds_between = 60 * run.options.resolved.checkpoint_minutes;
  const base::Stopwatch running;
  base::Stopwatch since_checkpoint;
  const std::int64_t first_step = fit.progress().step;
  bool stopped = false;
  fit.run([&](const fit::Fit&) {
    const ReconstructHooks& hooks = run.hooks;
    if (hooks.progress) hooks.progress(progress_report(fit, first_step, running));
    const bool stop = hooks.stop_requested && hooks.stop_requested() && !fit.is_done();
    const bool is_due = run.processes.is_root() && since_checkpoint.seconds() > seconds_between;
    // Any process can stop all of them. The root decides when it is time for a checkpoint.
    const double wanted = run.processes.allreduce_max(stop ? 2.0 : is_due ? 1.0 : 0.0);
    stopped = wanted == 2.0;
    if (wanted > 0.0 && run.writes_files()) {
      save_checkpoint(run.paths.model, fit, model_info(run.measurement, run.options), origin);
      since_checkpoint.restart();
    }
    return !stopped;
  });
  return !stopped;
}

}  // namespace

RunResult reconstruct(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                      const ReconstructHooks& hooks, const distributed::Communicator& processes) {
  RunRecord record{.origin = {}, .alignment = alignment_of(series)};
  base::log_info(base::describe_threads());
  Run run{.hooks = hooks,
          .processes = processes,
          .options = options,
          .paths = output_paths(options.resolved.output),
          .measurement = prepare(series, options, processes)};
  std::optional<TunedFit> tuned;
  if (!choose_settings(run, tuned)) return {.outcome = Outcome::kStoppedTuning, .results = {}};
  record.origin = origin_of(run, std::move(tuned));
  const std::unique_ptr<fit::Fit> fit = begin_fit(run);
  if (options.resolved.resume)
    processes.run_collectively([&] { resume(run, record.origin, *fit); });
  const base::Stopwatch running;
  if (!run_with_checkpoints(run, record.origin, *fit))
    return {.outcome = Outcome::kStopped, .results = {}};
  record.fit_seconds = running.seconds();
  return {.outcome = Outcome::kFinished,
          .results = finish(*fit, run.measurement, run.options, record, hooks.write_more)};
}

}  // namespace tomofield::reconstruction
