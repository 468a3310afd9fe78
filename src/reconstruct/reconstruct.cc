#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <system_error>

#include "base/lanes.h"
#include "base/log.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "io/json.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/fit.h"
#include "reconstruct/held_out_picture.h"
#include "reconstruct/mask_json.h"
#include "reconstruct/result_files.h"
#include "reconstruct/trials.h"
#include "tomofield/error.h"

namespace tomofield::reconstruct {
namespace {

// Each view's x-axis tilt, 2 × 2 matrix and shift.
nlohmann::json alignment_json(const geometry::RayGeometry& g) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < g.x_tilt_deg.size(); ++v) {
    const geometry::RawFromAligned& m = g.raw_from_aligned[v];
    views.push_back({g.x_tilt_deg[v], m.m11, m.m12, m.m21, m.m22, m.shift_x_px, m.shift_y_px});
  }
  return views;
}

// What decides the bits of a fit: the options, the geometry and the rays themselves (JSON).
std::string fingerprint_of(const ReconstructOptions& options, const PreparedSeries& series,
                           const distributed::Communicator& processes) {
  nlohmann::json json = options_json(options);
  json.erase("input");
  json.erase("volume");
  json["tilt_deg"] = series.geometry.tilt_deg;
  if (series.ray_geometry) json["alignment"] = alignment_json(*series.ray_geometry);
  json["bin_factor"] = series.bin_factor;
  json["unit"] = series.unit;
  json["noise_sigma"] = series.noise_sigma;
  json["rays"] = fmt::format("{:016x}", series.rays->checksum(processes));
  return json.dump();
}

field::ModelInfo model_info(const PreparedSeries& series, const ReconstructOptions& options) {
  field::ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.x_tilt_deg = series.x_tilt_deg;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = options.input.contrast == tilt_series::Contrast::kDark;
  info.options_json = options_json(options).dump();
  return info;
}

Measurement measurement_of(const PreparedSeries& series, const FitOptions& options,
                           const distributed::Communicator& processes) {
  return {.geometry = series.geometry,
          .roi = series.roi,
          .rays = series.rays.get(),
          .noise_sigma = series.noise_sigma,
          .mean_density = series.mean_density,
          .ray_geometry = series.ray_geometry,
          .held_out = held_out_views(series.geometry.tilt_deg, options.hold_out),
          .processes = &processes};
}

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
void resume(const OutputPaths& paths, const std::string& fingerprint, Fit& fit) {
  if (!std::filesystem::exists(paths.model)) {
    base::log_info(
        fmt::format("no checkpoint {} yet: starting from the beginning", paths.model.string()));
    return;
  }
  resuming([&] { restore_fit(paths.model, fingerprint, fit); });
  base::log_info(fmt::format("resuming {} at step {} of {}", paths.model.string(),
                             fit.progress().step, fit.num_steps()));
}

std::filesystem::path directory_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

base::ProgressReport progress_report(const Fit& fit, std::int64_t first_step,
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

// How an adaptive tree came about.
nlohmann::json tree_json(const TreeProgress& tree) {
  nlohmann::json updates = nlohmann::json::array();
  for (const TreeUpdate& u : tree.updates) {
    updates.push_back({{"epoch", u.epoch},
                       {"splits", u.splits},
                       {"merges", u.merges},
                       {"error", u.error},
                       {"predicted_error", u.predicted_error},
                       {"leaves_by_level", u.leaves_by_level}});
  }
  return updates;
}

nlohmann::json stages_json(const std::vector<Stage>& stages) {
  nlohmann::json list = nlohmann::json::array();
  for (const Stage& s : stages)
    list.push_back({{"bin", s.bin}, {"first_epoch", s.first_epoch}, {"epochs", s.epochs}});
  return list;
}

nlohmann::json figures_json(const field::Model& model, const Progress& progress,
                            const PreparedSeries& series, double seconds) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < progress.views.size(); ++v) {
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[v]},
                     {"scale", progress.views[v].scale},
                     {"offset", progress.views[v].offset * series.unit},
                     {"noise_sigma", series.noise_sigma[v] * series.unit}});
  }
  return {{"parameters", model.field->num_parameters()},
          {"leaves", model.field->tree().num_leaves()},
          {"tree_updates", tree_json(progress.tree)},
          {"steps", progress.step},
          {"mean_squared_residual_per_noise_variance", progress.data_loss},
          {"density_unit", series.unit},
          {"pixel_size_A", series.pixel_size_A},
          {"size_px", {series.roi.width(), series.roi.height(), series.geometry.thickness}},
          {"seconds", seconds},
          {"threads", base::thread_count()},
          {"mask", mask_json(series)},
          {"views", views}};
}

// The error of the views held out, and a picture of the one nearest to zero tilt.
nlohmann::json score_fit(const Fit& fit, const PreparedSeries& series, bool stopped_by_them,
                         const std::filesystem::path& picture) {
  const HeldOutError error = fit.held_out_error();
  const auto nearest = std::ranges::min_element(error.views, {}, [&](int view) {
    return std::abs(series.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  });
  const auto model = error.models[static_cast<std::size_t>(nearest - error.views.begin())];
  const PredictedView view = fit.predict_held_out(*nearest, model);
  fit.processes().together([&] {
    if (fit.processes().is_first()) write_held_out_picture(picture, view);
  });
  nlohmann::json json = report_held_out(error, series.geometry.tilt_deg, stopped_by_them);
  json["error_by_epoch"] = fit.progress().held_out_error;
  return json;
}

// What each process did in the steps of this run.
nlohmann::json processes_json(const Fit& fit, double seconds) {
  const distributed::Communicator& processes = fit.processes();
  const Fit::Traffic traffic = fit.traffic();
  constexpr std::size_t kNumbers = 5;
  std::vector<double> all(kNumbers * static_cast<std::size_t>(processes.size()));
  const auto own = all.begin() + static_cast<std::ptrdiff_t>(kNumbers) * processes.rank();
  const double steps = static_cast<double>(std::max<std::int64_t>(traffic.steps, 1));
  std::ranges::copy(std::array<double, kNumbers>{static_cast<double>(fit.own_bands().size()),
                                                 static_cast<double>(fit.own_leaves().size()),
                                                 seconds - traffic.seconds, traffic.seconds,
                                                 static_cast<double>(traffic.bytes) / steps},
                    own);
  processes.combine(std::span(all));
  nlohmann::json list = nlohmann::json::array();
  for (auto p = all.begin(); p != all.end(); p += kNumbers) {
    list.push_back({{"bands", std::lround(p[0])},
                    {"leaves", std::lround(p[1])},
                    {"seconds_computing", p[2]},
                    {"seconds_communicating", p[3]},
                    {"bytes_sent_per_step", p[4]}});
  }
  return list;
}

VolumeShare volume_share(const Fit& fit, const PreparedSeries& series) {
  const distributed::Range slabs = series.rays->held();
  const auto end_row =
      std::min<std::int64_t>(std::int64_t{slabs.end} * base::kLanes, series.roi.height());
  const distributed::Range leaves = fit.own_leaves();
  return {fit.processes(),
          {slabs.begin * base::kLanes, end_row},
          fit.field().offset(leaves.begin),
          fit.field().offset(leaves.end)};
}

void write_results(Fit& fit, const PreparedSeries& series, const ReconstructOptions& options,
                   const FitOrigin& origin, const OutputPaths& paths, double seconds) {
  nlohmann::json held_out = nullptr;
  if (options.fit.hold_out > 0)
    held_out = score_fit(fit, series, options.fit.patience > 0, paths.held_out_picture);
  save_fit(paths.model, fit, model_info(series, options), progress_state(fit, origin));
  const nlohmann::json processes = processes_json(fit, seconds);
  const VolumeShare share = volume_share(fit, series);
  field::Model model{model_info(series, options), fit.take_field()};
  write_volume(model, options.volume, paths.volume, share);
  nlohmann::json figures = figures_json(model, fit.progress(), series, seconds);
  figures["stages"] = stages_json(fit.stages());
  figures["held_out"] = held_out;
  figures["processes"] = processes;
  figures["tuning"] = origin.tuned ? tuning_json(*origin.tuned) : nlohmann::json(nullptr);
  share.processes.together([&] {
    if (!share.processes.is_first()) return;
    io::write_json(paths.json, {{"tomofield", TOMOFIELD_VERSION},
                                {"options", options_json(options)},
                                {"figures", figures}});
  });
}

// The settings that predict views held out from trials best. None if a stop was requested.
std::optional<Tuned> choose_settings(const PreparedSeries& series, const Measurement& measurement,
                                     const OutputPaths& paths, const ReconstructHooks& hooks,
                                     const ReconstructOptions& options) {
  const TuneHooks tune_hooks{.progress = hooks.tune_progress,
                             .stop_requested = hooks.stop_requested};
  if (!options.tune) return tune_penalty(measurement, options.field, options.fit, tune_hooks);
  const distributed::Communicator& processes = *measurement.processes;
  const std::string fingerprint = fingerprint_of(options, series, processes);
  std::optional<TrialFile> file;
  processes.together([&] { file.emplace(paths.trials, fingerprint, options.resume); });
  return tune(measurement, options.field, options.fit, options.choose_penalty, *file, tune_hooks);
}

void apply(const TrialSettings& settings, ReconstructOptions& options) {
  options.fit.penalty = settings.penalty;
  options.fit.density_variation = settings.variation;
  options.fit.epochs = settings.epochs;
  options.field.rank = settings.rank;
}

}  // namespace

OutputPaths output_paths(const std::filesystem::path& volume) {
  std::filesystem::path stem = volume;
  stem.replace_extension();
  const auto with = [&](const char* extension) {
    return std::filesystem::path(stem.string() + extension);
  };
  return {volume, with(".h5"),           with(".json"),     with("_tree.png"),
          stem,   with("_held_out.png"), with("_tune.json")};
}

int ReconstructOptions::num_trials(int num_fitted_views) const {
  constexpr int kFewestViews = 14;
  if (tune) return expected_trials({.penalty = choose_penalty, .rank = field.kind == "vm"});
  return choose_penalty && fit.engine == "slab" && num_fitted_views >= kFewestViews ? 2 : 0;
}

std::vector<std::string> ReconstructOptions::faults() const {
  std::vector<std::string> all = specimen.faults();
  for (const auto& faults : {field.faults(), fit.faults()})
    all.insert(all.end(), faults.begin(), faults.end());
  if (tune && fit.engine == "ray")
    all.push_back("--tune predicts aligned views: it needs --engine slab");
  if (tune && fit.patience > 0)
    all.push_back("--tune chooses the number of epochs: leave --early-stop out");
  if (!(checkpoint_minutes >= 0))
    all.push_back(
        fmt::format("--checkpoint-minutes must be 0 or more, not {:g}", checkpoint_minutes));
  return all;
}

std::vector<std::string> ReconstructOptions::faults_of_job() const {
  std::vector<std::string> all;
  const auto refuse = [&](const char* option) {
    all.push_back(fmt::format(
        "several processes cannot share {} yet: start one, with more --threads", option));
  };
  if (field.tree == "adaptive") refuse("--tree adaptive");
  if (fit.engine == "ray") refuse("--engine ray");
  return all;
}

void check_options(const ReconstructOptions& options) {
  require_no_faults(options.faults());
  const OutputPaths paths = output_paths(options.output);
  // Without a checkpoint there is nothing to resume, and what else is there is not this run's.
  const bool resumes = options.resume && (std::filesystem::exists(paths.model) ||
                                          (options.tune && std::filesystem::exists(paths.trials)));
  std::vector<std::filesystem::path> results{paths.volume, paths.model, paths.json};
  if (options.field.tree == "adaptive") results.push_back(paths.tree_picture);
  if (options.tune) results.push_back(paths.trials);
  if (options.fit.hold_out > 0) results.push_back(paths.held_out_picture);
  check_result_files(
      std::move(results), paths.picture_prefix, options.input, options.overwrite || resumes,
      options.resume ? "there is no checkpoint to resume, so give --overwrite to start over and "
                       "replace it, or another name with -o"
                     : "give --overwrite to replace it, --resume to continue the run that made "
                       "it, or another name with -o");
}

Outcome reconstruct(const tilt_series::TiltSeries& tilt_series, const ReconstructOptions& requested,
                    const ReconstructHooks& hooks, const distributed::Communicator& processes) {
  ReconstructOptions options = requested;
  const OutputPaths paths = output_paths(options.output);
  const PreparedSeries series =
      prepare_series(tilt_series, options.specimen, directory_of(paths.volume),
                     band_rows(options.field), processes);
  const Measurement measurement = measurement_of(series, options.fit, processes);
  FitOrigin origin;
  if (options.num_trials(measurement.num_fitted_views()) > 0) {
    const bool has_checkpoint = options.resume && std::filesystem::exists(paths.model);
    if (has_checkpoint) {
      processes.together([&] { resuming([&] { origin.tuned = stored_choice(paths.model); }); });
    } else {
      origin.tuned = choose_settings(series, measurement, paths, hooks, options);
      if (!origin.tuned) return Outcome::kStoppedTuning;
    }
    if (origin.tuned) apply(origin.tuned->settings, options);
  }
  origin.fingerprint = fingerprint_of(options, series, processes);
  Fit fit(measurement, options.field, options.fit);
  if (options.resume) processes.together([&] { resume(paths, origin.fingerprint, fit); });

  const base::Stopwatch running;
  base::Stopwatch since_checkpoint;
  const std::int64_t first_step = fit.progress().step;
  bool stopped = false;
  fit.run([&](const Fit&) {
    if (hooks.progress) hooks.progress(progress_report(fit, first_step, running));
    const bool stop = hooks.stop_requested && hooks.stop_requested() && !fit.is_done();
    const bool is_due =
        processes.is_first() && since_checkpoint.seconds() > 60 * options.checkpoint_minutes;
    // One that must stop stops all; when it is time for a checkpoint is up to the first.
    const double wanted = processes.largest(stop ? 2.0 : is_due ? 1.0 : 0.0);
    stopped = wanted == 2.0;
    if (wanted > 0.0) {
      save_checkpoint(paths.model, fit, model_info(series, options), origin);
      since_checkpoint.restart();
    }
    return !stopped;
  });
  if (stopped) return Outcome::kStopped;
  write_results(fit, series, options, origin, paths, running.seconds());
  return Outcome::kFinished;
}

}  // namespace tomofield::reconstruct
