#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "checkpoint/checkpoint.h"
#include "checkpoint/finished_tiles.h"
#include "fit/domain.h"
#include "io/saving/scratch_memory.h"
#include "measurement/background.h"
#include "measurement/held_out.h"
#include "measurement/undecided_beads.h"
#include "measurement/view_transfers.h"
#include "options/denoise_factor.h"
#include "output/output_paths.h"
#include "plan/plan.h"
#include "reconstruct/halves.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "reconstruct/run_fit.h"
#include "reconstruct/tiled_run.h"
#include "report/denoise_dial.h"
#include "report/prior_picture.h"
#include "tune/tuning.h"

namespace tomofield::reconstruction {
namespace {

// Prepares the views and holds some of them out, as the options say.
measurement::Measurement prepare(const tilt_series::TiltSeries& series,
                                 const options::ReconstructOptions& options,
                                 const distributed::Communicator& processes) {
  const base::TraceSpan span("prepare rays");
  std::vector<microscope::ViewTransfer> transfers;
  processes.run_collectively([&] {
    transfers = measurement::view_transfers(options.files, options.resolved, options.input, series);
  });
  measurement::Measurement measurement = measurement::prepare_measurement(
      series, options.specimen, io::scratch_directory(options.resolved.output),
      fit::band_rows(options.field), processes, std::move(transfers));
  measurement.held_out =
      measurement::held_out_views(measurement.geometry.tilt_deg, options.fit.hold_out);
  return measurement;
}

// Makes the trials and chooses settings by them. Returns nothing if a stop was requested.
std::optional<tune::TunedFit> choose_by_trials(const Run& run, const tune::OpenSettings& open) {
  const options::ReconstructOptions& options = run.options;
  const tune::TuneHooks hooks{.progress = run.hooks.tune_progress,
                              .stop_requested = run.hooks.stop_requested};
  if (!options.resolved.tune)
    return tune::choose_by_short_trials(run.measurement, options.field, options.fit, open, hooks,
                                        run.processes);
  const std::string fingerprint =
      checkpoint::fingerprint_of(options, run.measurement, run.processes);
  const std::filesystem::path path = run.writes_files() ? run.paths.trials : "";
  std::optional<tune::TrialFile> file;
  run.processes.run_collectively([&] { file.emplace(path, fingerprint, options.resolved.resume); });
  return tune::tune(run.measurement, options.field, options.fit, open, *file, hooks, run.processes);
}

// Takes over what was chosen, and corrects the views as it says.
void apply(const tune::TrialSettings& settings, Run& run) {
  options::ReconstructOptions& options = run.options;
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
  if (options.open.spikes) resolved.spike_rank = options.fit.spike_rank = settings.spike_rank;
  if (options.open.prior) resolved.prior = options.fit.prior = settings.prior;
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

// Multiplies the weight of total variation by what --denoise says. The options keep the weight that
// was given or chosen, so that they make the same fit when they are given again.
void turn_the_dial(options::ReconstructOptions& options) {
  options.fit.density_variation *= options::denoise_factor(options.resolved.denoise);
  if (options.resolved.denoise != Options().denoise)
    base::log_info(fmt::format("--denoise {}: the weight of total variation is {:.3g}",
                               options.resolved.denoise, options.fit.density_variation));
}

// Shows what the dial and the learned prior do. A resumed run keeps the pictures of its first
// session: the trials that it reads have no sections. A run without trials removes those of an
// earlier run.
void show_trials(const Run& run, const std::optional<tune::TunedFit>& tuned) {
  if (!run.writes_files() || !run.processes.is_root()) return;
  if (tuned && tuned->trials.front().section.values.empty()) return;
  const tune::TunedFit shown = tuned.value_or(tune::TunedFit());
  const double sign = run.options.input.contrast == Contrast::kDark ? -1 : 1;
  const double output_scale = run.options.volume.invert ? -sign : sign;
  if (run.options.chooses_weight())
    report::write_dial_picture(shown, output_scale, run.paths.dial_picture);
  if (run.options.open.prior)
    report::write_prior_picture(shown, output_scale, run.paths.prior_picture);
}

// Chooses the settings that are left to trials. A resumed run takes those that its checkpoint has.
// Returns false if a stop was requested.
bool choose_settings(Run& run, std::optional<tune::TunedFit>& tuned) {
  const base::TraceSpan span("choose settings");
  const tune::OpenSettings open = tune::open_settings(run.options.open, run.measurement);
  const bool makes_trials = run.options.num_trials(run.measurement.num_fitted_views(), open) > 0;
  if (makes_trials && run.options.resolved.resume && std::filesystem::exists(run.paths.model)) {
    run.processes.run_collectively([&] {
      checkpoint::read_checkpoint([&] { tuned = checkpoint::stored_choice(run.paths.model); });
    });
  } else if (makes_trials) {
    tuned = choose_by_trials(run, open);
    if (!tuned) return false;
  }
  if (tuned) apply(tuned->settings, run);
  turn_the_dial(run.options);
  measurement::keep_beads(run.measurement);
  return true;
}

Run begin_run(const tilt_series::TiltSeries& series, const options::ReconstructOptions& options,
              const ReconstructHooks& hooks, const distributed::Communicator& processes) {
  return {.hooks = hooks,
          .processes = processes,
          .options = options,
          .paths = output::output_paths(options.resolved.output),
          .measurement = prepare(series, options, processes)};
}

// Returns what the fit is made from. All processes call it.
checkpoint::FitOrigin origin_of(const Run& run, std::optional<tune::TunedFit> tuned) {
  const base::TraceSpan span("fingerprint");
  return {.fingerprint = checkpoint::fingerprint_of(run.options, run.measurement, run.processes),
          .tuned = std::move(tuned)};
}

// Returns where each view comes from in the stack.
std::vector<geometry::RawFromAligned> alignment_of(const tilt_series::TiltSeries& series) {
  std::vector<geometry::RawFromAligned> alignment;
  for (std::size_t view = 0; view < series.views().size(); ++view)
    alignment.push_back(series.raw_from_aligned(view));
  return alignment;
}

// Fits all views and writes the results.
RunResult fit_all_views(const Run& run, const plan::TilePlan& tiles, RunRecord& record,
                        std::optional<tune::TunedFit> tuned) {
  record.origin = origin_of(run, std::move(tuned));
  if (!run.options.resolved.budget.empty()) record.origin.tile_rows = tiles.rows;
  if (!run.options.resolved.resume) checkpoint::forget_old_tiles(run.options, run.processes);
  if (tiles.is_used()) return fit_by_tiles(run, tiles, record);
  const FitRun made = run_fit(run, {.measurement = run.measurement,
                                    .model = run.paths.model,
                                    .origin = record.origin,
                                    .resumes = run.options.resolved.resume,
                                    .progress = run.hooks.progress});
  if (made.was_stopped)
    return {.outcome = Outcome::kStopped, .results = {}, .checkpoint = run.paths.model};
  record.fit_seconds = made.seconds;
  return {.outcome = Outcome::kFinished,
          .results = finish(*made.fit, run.measurement, run.options, record, run.hooks.write_more)};
}

}  // namespace

RunResult reconstruct(const tilt_series::TiltSeries& series,
                      const options::ReconstructOptions& options, const ReconstructHooks& hooks,
                      const distributed::Communicator& processes) {
  RunRecord record;
  record.alignment = alignment_of(series);
  base::log_info(base::describe_threads());
  plan::TilePlan tiles;
  if (!options.resolved.budget.empty()) tiles = plan::plan_run(series, options, processes).tiles;
  Run run = begin_run(series, options, hooks, processes);
  std::optional<tune::TunedFit> tuned;
  if (!choose_settings(run, tuned)) return {.outcome = Outcome::kStoppedTuning};
  processes.run_collectively([&] { show_trials(run, tuned); });
  if (options.makes_halves()) return reconstruct_halves(series, run, record, tuned);
  return fit_all_views(run, tiles, record, std::move(tuned));
}

std::optional<nlohmann::json> choose_settings_alone(const tilt_series::TiltSeries& series,
                                                    const options::ReconstructOptions& options,
                                                    const ReconstructHooks& hooks,
                                                    const distributed::Communicator& processes) {
  base::log_info(base::describe_threads());
  Run run = begin_run(series, options, hooks, processes);
  std::optional<tune::TunedFit> tuned;
  if (!choose_settings(run, tuned)) return std::nullopt;
  return tuned ? tune::tuning_json(*tuned) : nlohmann::json(nullptr);
}

}  // namespace tomofield::reconstruction
