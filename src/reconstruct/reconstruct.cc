#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/log.h"
#include "base/stopwatch.h"
#include "fit/fit.h"
#include "io/scratch_memory.h"
#include "measurement/held_out.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/fingerprint.h"
#include "reconstruct/results.h"
#include "reconstruct/tuning.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

// Calls what reads the checkpoint.
void resuming(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    throw Error(fmt::format(
        "cannot resume: {}; to start over, give --overwrite instead of --resume", error.what()));
  }
}

// Loads the checkpoint, if there is one yet, into `fit`.
void resume(const OutputPaths& paths, const std::string& fingerprint, fit::Fit& fit) {
  if (!std::filesystem::exists(paths.model)) {
    base::log_info(
        fmt::format("no checkpoint {} yet: starting from the beginning", paths.model.string()));
    return;
  }
  resuming([&] { restore_fit(paths.model, fingerprint, fit); });
  base::log_info(fmt::format("resuming {} at step {} of {}", paths.model.string(),
                             fit.progress().step, fit.num_steps()));
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

// The settings that predict views held out from trials best. None if a stop was requested.
std::optional<TunedFit> choose_settings(const measurement::Measurement& measurement,
                                        const OutputPaths& paths, const ReconstructHooks& hooks,
                                        const ReconstructOptions& options,
                                        const distributed::Communicator& processes) {
  const TuneHooks tune_hooks{.progress = hooks.tune_progress,
                             .stop_requested = hooks.stop_requested};
  if (!options.resolved.tune)
    return tune_penalty(measurement, options.field, options.fit, tune_hooks, processes);
  const std::string fingerprint = fingerprint_of(options, measurement, processes);
  std::optional<selection::TrialFile> file;
  const std::filesystem::path trials =
      options.resolved.output.empty() ? std::filesystem::path() : paths.trials;
  processes.run_collectively([&] { file.emplace(trials, fingerprint, options.resolved.resume); });
  return tune(measurement, options.field, options.fit, options.choose_penalty, *file, tune_hooks,
              processes);
}

void apply(const TrialSettings& settings, ReconstructOptions& options) {
  Options& resolved = options.resolved;
  resolved.penalty = options.fit.penalty = settings.penalty;
  resolved.density_variation = options.fit.density_variation = settings.variation;
  resolved.epochs = options.fit.epochs = settings.epochs;
  resolved.rank = options.field.rank = settings.rank;
}

// Chooses what `options` leave to trials, or takes what the run that is resumed has chosen; false
// if a stop was requested.
bool settle_options(const measurement::Measurement& measurement, const OutputPaths& paths,
                    const ReconstructHooks& hooks, const distributed::Communicator& processes,
                    ReconstructOptions& options, std::optional<TunedFit>& tuned) {
  if (options.num_trials(measurement.num_fitted_views()) == 0) return true;
  if (options.resolved.resume && std::filesystem::exists(paths.model)) {
    processes.run_collectively([&] { resuming([&] { tuned = stored_choice(paths.model); }); });
  } else {
    tuned = choose_settings(measurement, paths, hooks, options, processes);
    if (!tuned) return false;
  }
  if (tuned) apply(tuned->settings, options);
  return true;
}

// Fits, and calls save(), if there is one, when a checkpoint is due; false if it was stopped, after
// one.
bool run_with_checkpoints(fit::Fit& fit, double checkpoint_minutes, const ReconstructHooks& hooks,
                          const std::function<void()>& save) {
  const base::Stopwatch running;
  base::Stopwatch since_checkpoint;
  const std::int64_t first_step = fit.progress().step;
  bool stopped = false;
  fit.run([&](const fit::Fit&) {
    if (hooks.progress) hooks.progress(progress_report(fit, first_step, running));
    const bool stop = hooks.stop_requested && hooks.stop_requested() && !fit.is_done();
    const bool is_due =
        fit.processes().is_root() && since_checkpoint.seconds() > 60 * checkpoint_minutes;
    // One that must stop stops all; when it is time for a checkpoint is up to the first.
    const double wanted = fit.processes().allreduce_max(stop ? 2.0 : is_due ? 1.0 : 0.0);
    stopped = wanted == 2.0;
    if (wanted > 0.0 && save) {
      save();
      since_checkpoint.restart();
    }
    return !stopped;
  });
  return !stopped;
}

}  // namespace

RunResult reconstruct(const tilt_series::TiltSeries& tilt_series,
                      const ReconstructOptions& requested, const ReconstructHooks& hooks,
                      const distributed::Communicator& processes) {
  ReconstructOptions options = requested;
  const OutputPaths paths = output_paths(options.resolved.output);
  measurement::Measurement measurement = measurement::prepare_measurement(
      tilt_series, options.specimen, io::scratch_directory(options.resolved.output),
      fit::band_rows(options.field), processes);
  measurement.held_out =
      measurement::held_out_views(measurement.geometry.tilt_deg, options.fit.hold_out);
  FitOrigin origin;
  if (!settle_options(measurement, paths, hooks, processes, options, origin.tuned))
    return {.outcome = Outcome::kStoppedTuning, .results = {}};
  origin.fingerprint = fingerprint_of(options, measurement, processes);
  fit::Fit fit(measurement, options.field, options.fit, processes);
  if (options.resolved.resume)
    processes.run_collectively([&] { resume(paths, origin.fingerprint, fit); });

  const base::Stopwatch running;
  std::function<void()> save;
  if (!options.resolved.output.empty())
    save = [&] { save_checkpoint(paths.model, fit, model_info(measurement, options), origin); };
  if (!run_with_checkpoints(fit, options.resolved.checkpoint_minutes, hooks, save))
    return {.outcome = Outcome::kStopped, .results = {}};
  return {.outcome = Outcome::kFinished,
          .results = finish(fit, measurement, options, origin, running.seconds())};
}

}  // namespace tomofield::reconstruction
