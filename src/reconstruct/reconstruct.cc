#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
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
#include "exchange/alignment_output.h"
#include "fit/domain.h"
#include "fit/stages.h"
#include "io/saving/output_set.h"
#include "io/saving/scratch_memory.h"
#include "measurement/background.h"
#include "measurement/held_out.h"
#include "measurement/undecided_beads.h"
#include "measurement/view_transfers.h"
#include "options/run_options.h"
#include "output/output_paths.h"
#include "plan/plan.h"
#include "plan/run_estimate.h"
#include "realign/aligned_series.h"
#include "reconstruct/halves.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "reconstruct/run_files.h"
#include "reconstruct/run_fit.h"
#include "reconstruct/tiled_run.h"
#include "report/denoise_dial.h"
#include "report/pictures.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"
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
    transfers = measurement::view_transfers(options.input(), options.specimen.hand, series);
  });
  measurement::Measurement measurement = measurement::prepare_measurement(
      series, options.specimen, io::scratch_directory(options.run.output),
      fit::band_rows(options.field), processes, std::move(transfers));
  measurement.held_out =
      measurement::held_out_views(measurement.geometry.tilt_deg, options.fit.hold_out);
  return measurement;
}

// Removes the model and the trials of an earlier run once this one stores an alignment or trials:
// if it is resumed, it must not take them for its own.
void forget_old_progress(const options::ReconstructOptions& options,
                         const distributed::Communicator& processes) {
  if (options.run.output.empty() || options.run.resume || !processes.is_root()) return;
  const output::OutputPaths paths = output::output_paths(options.run.output);
  std::error_code ignored;
  std::filesystem::remove(paths.model, ignored);
  if (options.fit.tune) std::filesystem::remove(paths.trials, ignored);
}

// Makes the trials and chooses settings by them. Returns nothing if a stop was requested.
std::optional<tune::TunedFit> choose_by_trials(const Run& run, const tune::OpenSettings& open) {
  const options::ReconstructOptions& options = run.options;
  const tune::TuneHooks hooks{.progress = run.observer.trials,
                              .stop_requested = run.observer.stop_requested};
  std::optional<tune::TrialFile> file;  // short trials are not worth one
  if (options.fit.tune) {
    const std::string fingerprint =
        checkpoint::fingerprint_of(options, run.measurement, run.processes);
    const std::filesystem::path path = run.writes_files() ? run.paths.trials : "";
    forget_old_progress(options, run.processes);
    run.processes.run_collectively([&] { file.emplace(path, fingerprint, options.run.resume); });
  }
  return tune::choose_settings(run.measurement, options.field, options.fit, open,
                               file ? &*file : nullptr, hooks, run.processes);
}

// Takes over what was chosen, and corrects the views as it says.
void apply(const tune::TrialSettings& settings, Run& run) {
  const tune::OpenSettings open = run.options.open_settings();
  ViewOptions& views = run.options.views;
  FitOptions& fit = run.options.fit;
  if (open.variation) fit.penalty.choose(settings.penalty);
  if (open.variation || fit.tune) fit.density_variation.choose(settings.variation);
  if (fit.tune) {
    fit.epochs.choose(settings.epochs);
    run.options.field.rank.choose(settings.rank);
  }
  if (open.view_scale) fit.fit_view_scale.choose(settings.fits_view_scale);
  if (open.spikes) fit.spike_rank.choose(settings.spike_rank);
  if (open.prior) fit.prior.choose(settings.prior);
  if (open.background) {
    views.black_level.choose(settings.background_part * run.measurement.background *
                             run.measurement.unit);
    measurement::subtract_background(settings.background_part, run.measurement);
  }
  if (!run.measurement.undecided_beads.empty())
    views.bead_diameter_nm.choose(settings.masks_beads ? run.measurement.masks.bead_diameter_A / 10
                                                       : 0.0);
  if (settings.masks_beads) measurement::hide_beads(run.measurement, run.processes);
}

void log_denoise(const FitOptions& fit) {
  if (fit.denoise != FitOptions().denoise)
    base::log_info(fmt::format("--denoise {}: the weight of total variation is {:.3g}", fit.denoise,
                               *options::with_denoise(fit).density_variation));
}

// Shows what the dial and the learned prior do. A resumed run keeps the pictures of its first
// session: the trials that it reads have no sections. A run without trials removes those of an
// earlier run.
void show_trials(const Run& run, const std::optional<tune::TunedFit>& tuned) {
  if (!run.writes_files() || !run.processes.is_root()) return;
  if (tuned && tuned->trials.front().section.values.empty()) return;
  const tune::TunedFit shown = tuned.value_or(tune::TunedFit());
  const double sign = run.options.views.contrast == Contrast::kDark ? -1 : 1;
  const double output_scale = run.options.volume.invert ? -sign : sign;
  if (run.options.chooses_weight())
    report::write_dial_picture(shown, output_scale, run.paths.dial_picture);
  if (run.options.open_settings().prior)
    report::write_prior_picture(shown, output_scale, run.paths.prior_picture);
}

// Chooses the settings that are left to trials. A resumed run takes those that its checkpoint has.
// Returns false if a stop was requested.
bool choose_settings(Run& run, std::optional<tune::TunedFit>& tuned) {
  const base::TraceSpan span("choose settings");
  const tune::OpenSettings open = tune::open_settings(run.options.open_settings(), run.measurement);
  const bool makes_trials = run.options.num_trials(run.measurement.num_fitted_views(), open) > 0;
  if (makes_trials && run.options.run.resume && std::filesystem::exists(run.paths.model)) {
    run.processes.run_collectively([&] {
      checkpoint::read_checkpoint([&] { tuned = checkpoint::stored_choice(run.paths.model); });
    });
  } else if (makes_trials) {
    tuned = choose_by_trials(run, open);
    if (!tuned) return false;
  }
  if (tuned) apply(tuned->settings, run);
  log_denoise(run.options.fit);
  measurement::keep_beads(run.measurement);
  return true;
}

// Returns where each view comes from in the stack.
std::vector<geometry::RawFromAligned> alignment_of(const tilt_series::PlannedSeries& series) {
  std::vector<geometry::RawFromAligned> alignment;
  for (std::size_t view = 0; view < series.views().size(); ++view)
    alignment.push_back(series.raw_from_aligned(view));
  return alignment;
}

// Locks the results. The other processes only check.
std::vector<io::OutputLock> claim(const options::ReconstructOptions& options,
                                  const distributed::Communicator& processes) {
  std::vector<io::OutputLock> locks;
  processes.run_collectively([&] {
    if (processes.is_root())
      locks = claim_outputs(options);
    else
      check_options(options);
  });
  return locks;
}

// Aligns the views, if the options ask for it. Returns false if a stop was requested.
bool align_views(options::ReconstructOptions& options, const Observer& observer,
                 const distributed::Communicator& processes) {
  return realign::align_series(
      options, {.progress = observer.alignment, .stop_requested = observer.stop_requested},
      processes);
}

// Aligns the views before a fit, if the options ask for it. Returns false if a stop was requested.
bool align_for_fit(options::ReconstructOptions& options, const Observer& observer,
                   const distributed::Communicator& processes) {
  if (options.run.align == Alignment::kOff) return true;
  if (!align_views(options, observer, processes)) return false;
  forget_old_progress(options, processes);
  return true;
}

// Notes the tilt axis by which views are turned because a file states it.
void note_axis(const tilt_series::PlannedSeries& series, options::ReconstructOptions& options) {
  const auto& axis = series.stated_axis();
  if (!axis || axis->is_given) return;
  options.views.tilt_axis_deg = axis->angle_deg;
  options.settings.push_back({.option = "--tilt-axis",
                              .value = fmt::format("{:.6g}", axis->angle_deg),
                              .file = axis->source,
                              .entry = ""});
}

// Says if leaves are too small for the coarse stages that were asked for.
void log_coarse_stages(const plan::RunPlan& plan, const options::ReconstructOptions& options) {
  const FitOptions& fit = options.fit;
  if (fit.coarse_epochs == 0 || fit.engine != Engine::kSlab) return;
  const int coarsest = std::ranges::max_element(plan.stages, {}, &fit::Stage::bin)->bin;
  if (coarsest == 1)
    base::log_info(
        "no coarse stage: leaves of this --leaf-size do not end with slabs of coarse pixels");
  else if (fit.coarse_bin > std::max(coarsest, FitOptions().coarse_bin))
    base::log_info(
        fmt::format("coarse pixels are at most {0} × {0} and not {1} × {1} (--coarse-bin)"
                    ", because leaves have {2} pixels a side (--leaf-size)",
                    coarsest, fit.coarse_bin, *options.field.leaf_size));
}

// Plans the run, and tells the observer.
plan::RunPlan make_plan(const tilt_series::PlannedSeries& series,
                        const options::ReconstructOptions& options, const Observer& observer,
                        const distributed::Communicator& processes) {
  plan::RunPlan plan;
  processes.run_collectively([&] {
    plan = plan::require_possible_run(series, options, processes);
    if (processes.is_root()) plan::require_disk(plan, options);
    if (plan.has_too_few_views_for_trials)
      base::log_info(fmt::format(
          "{} views are too few for trials, which leave some of them out and need {} or more: "
          "what they would choose has its usual value (--tv-penalty, --tv and --prior give others)",
          plan.num_views, options::kFewestViewsOfTrials));
    log_coarse_stages(plan, options);
    if (observer.planned) observer.planned(plan);
  });
  return plan;
}

Run begin_run(const tilt_series::TiltSeries& series, options::ReconstructOptions options,
              const Observer& observer, const distributed::Communicator& processes) {
  base::log_info(base::describe_threads());
  measurement::Measurement measured = prepare(series, options, processes);
  const output::OutputPaths paths = output::output_paths(options.run.output);
  return {.observer = observer,
          .processes = processes,
          .series = series,
          .options = std::move(options),
          .paths = paths,
          .alignment = alignment_of(series),
          .measurement = std::move(measured)};
}

// Returns what the fit is made from. All processes call it.
checkpoint::FitOrigin origin_of(const Run& run, std::optional<tune::TunedFit> tuned) {
  const base::TraceSpan span("fingerprint");
  return {.fingerprint = checkpoint::fingerprint_of(run.options, run.measurement, run.processes),
          .tuned = std::move(tuned)};
}

// Fits all views and writes the results.
RunResult fit_all_views(const Run& run, const plan::TilePlan& tiles,
                        std::optional<tune::TunedFit> tuned) {
  FitOutcome outcome{.origin = origin_of(run, std::move(tuned))};
  if (!run.options.field.budget.empty()) outcome.origin.tile_rows = tiles.rows;
  outcome.origin.are_tile_rows_given = run.options.field.tile_rows.has_value();
  if (!run.options.run.resume) checkpoint::forget_old_tiles(run.options, run.processes);
  if (tiles.is_used()) return fit_by_tiles(run, tiles, outcome);
  const FitRun made = run_fit(run, {.measurement = run.measurement,
                                    .model = run.paths.model,
                                    .origin = outcome.origin,
                                    .resumes = run.options.run.resume,
                                    .progress = run.observer.fit});
  if (made.was_stopped) return {.outcome = Outcome::kStopped, .checkpoint = run.paths.model};
  outcome.seconds = made.seconds;
  return finish(*made.fit, run, outcome);
}

}  // namespace

RunResult run(options::ReconstructOptions options, const Observer& observer,
              const distributed::Communicator& processes) {
  const std::vector<io::OutputLock> locks = claim(options, processes);
  plan::check_before_reading(options, processes);
  if (!align_for_fit(options, observer, processes)) return {.outcome = Outcome::kStoppedAligning};
  const tilt_series::TiltSeries series(options.input(), processes);
  const plan::RunPlan plan = make_plan(series, options, observer, processes);
  note_axis(series, options);
  Run run = begin_run(series, std::move(options), observer, processes);
  std::optional<tune::TunedFit> tuned;
  if (!choose_settings(run, tuned)) return {.outcome = Outcome::kStoppedTuning};
  processes.run_collectively([&] { show_trials(run, tuned); });
  RunResult result = run.options.makes_halves() ? reconstruct_halves(run, tuned)
                                                : fit_all_views(run, plan.tiles, std::move(tuned));
  result.options = run.options;
  return result;
}

Preview preview(const options::ReconstructOptions& options,
                const distributed::Communicator& processes) {
  processes.run_collectively([&] { check_options(options); });
  const tilt_series::MeasuredSeries series(options.input(), processes);
  Preview preview;
  preview.plan = make_plan(series, options, {}, processes);
  processes.run_collectively([&] {
    if (processes.is_root()) preview.estimate = plan::estimate_run(series, options, preview.plan);
  });
  return preview;
}

bool choose(const std::filesystem::path& file, options::ReconstructOptions options,
            const Observer& observer, const distributed::Communicator& processes) {
  const std::vector<io::OutputLock> locks = claim(options, processes);
  plan::check_before_reading(options, processes);
  if (!align_for_fit(options, observer, processes)) return false;
  const tilt_series::TiltSeries series(options.input(), processes);
  make_plan(series, options, observer, processes);
  Run run = begin_run(series, std::move(options), observer, processes);
  std::optional<tune::TunedFit> tuned;
  if (!choose_settings(run, tuned)) return false;
  processes.run_collectively([&] {
    if (processes.is_root()) tune::write_choice(file, tuned);
  });
  return true;
}

bool align(options::ReconstructOptions& options, const Observer& observer) {
  const auto& alone = distributed::Communicator::alone();
  if (options.run.align == Alignment::kOff)
    throw Error("there is nothing to do with --align off: give refine or full");
  const std::vector<io::OutputLock> locks = exchange::claim_alignment(options);
  plan::check_alignment_alone(options);
  io::OutputSet results;  // the record of the alignment joins the other files
  if (!align_views(options, observer, alone)) return false;
  exchange::write_alignment_results(tilt_series::PlannedSeries(options.input()), options);
  results.commit();
  return true;
}

}  // namespace tomofield::reconstruction
