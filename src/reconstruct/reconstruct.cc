#include "reconstruct/reconstruct.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <system_error>

#include "base/log.h"
#include "base/parallel.h"
#include "field/model_file.h"
#include "io/json.h"
#include "reconstruct/checkpoint.h"
#include "reconstruct/fit.h"
#include "report/slices.h"
#include "tomofield/error.h"

namespace tomofield::reconstruct {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// What decides the bits of a fit: the options and the rays themselves.
std::string fingerprint_of(const ReconstructOptions& options, const PreparedSeries& series) {
  nlohmann::json json = options_json(options);
  json.erase("input");
  return fmt::format("{} rays {:016x}", json.dump(), series.rays->checksum());
}

field::ModelInfo model_info(const PreparedSeries& series, const ReconstructOptions& options) {
  field::ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = options.input.contrast == tilt_series::Contrast::kDark;
  info.options_json = options_json(options).dump();
  return info;
}

Measurement measurement_of(const PreparedSeries& series) {
  return {series.geometry, series.roi, series.rays.get(), series.noise_sigma, series.mean_density};
}

// Loads the checkpoint into `fit`; false if there is none yet.
bool resume(const OutputPaths& paths, const std::string& fingerprint, Fit& fit) {
  if (!std::filesystem::exists(paths.model)) {
    base::log_info(
        fmt::format("no checkpoint {} yet: starting from the beginning", paths.model.string()));
    return false;
  }
  field::TrainingState state;
  const field::Model model = field::load_model(paths.model, &state);
  restore_state(paths.model.string(), fingerprint, *model.field, state, fit);
  base::log_info(fmt::format("resuming {} at step {} of {}", paths.model.string(),
                             fit.progress().step, fit.num_steps()));
  return true;
}

void refuse_existing(const OutputPaths& paths) {
  for (const auto& path : {paths.volume, paths.model, paths.json}) {
    if (std::filesystem::exists(path)) {
      throw Error(
          fmt::format("{} exists already: give --overwrite to replace it, --resume to continue the "
                      "run that made "
                      "it, or another name with -o",
                      path.string()));
    }
  }
}

std::filesystem::path directory_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

base::ProgressReport progress_report(const Fit& fit, std::int64_t first_step,
                                     Clock::time_point start) {
  base::ProgressReport report;
  const double done = static_cast<double>(fit.progress().step),
               all = static_cast<double>(fit.num_steps());
  report.fraction_done = done / all;
  report.seconds_elapsed = seconds_since(start);
  const double rate = (done - static_cast<double>(first_step)) / report.seconds_elapsed;
  report.seconds_left = (all - done) / rate;
  const auto& loss = fit.progress().data_loss;
  report.detail = fmt::format("epoch {}  loss {}  {:.1f} steps/s", loss.size() + 1,
                              loss.empty() ? "-" : fmt::format("{:.4f}", loss.back()), rate);
  return report;
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
          {"steps", progress.step},
          {"mean_squared_residual_per_noise_variance", progress.data_loss},
          {"density_unit", series.unit},
          {"pixel_size_A", series.pixel_size_A},
          {"size_px", {series.roi.width(), series.roi.height(), series.geometry.thickness}},
          {"seconds", seconds},
          {"threads", base::thread_count()},
          {"views", views}};
}

void write_results(Fit& fit, const PreparedSeries& series, const ReconstructOptions& options,
                   const OutputPaths& paths, const std::string& fingerprint, double seconds) {
  const field::TrainingState state = save_state(fit, fingerprint, /*with_moments=*/false);
  field::Model model{model_info(series, options), fit.take_field()};
  field::save_model(paths.model, model, &state);
  write_volume(model, options.volume, paths.volume);
  report::write_slice_pictures(paths.volume, paths.picture_prefix);
  io::write_json(paths.json, {{"tomofield", TOMOFIELD_VERSION},
                              {"options", options_json(options)},
                              {"figures", figures_json(model, fit.progress(), series, seconds)}});
}

}  // namespace

OutputPaths output_paths(const std::filesystem::path& volume) {
  std::filesystem::path stem = volume;
  stem.replace_extension();
  const auto with = [&](const char* extension) {
    return std::filesystem::path(stem.string() + extension);
  };
  return {volume, with(".h5"), with(".json"), stem};
}

void check_outputs(const ReconstructOptions& options) {
  const OutputPaths paths = output_paths(options.output);
  if (!options.overwrite && !options.resume) refuse_existing(paths);
  const io::AtomicFile probe(paths.volume);  // the directory can be written
}

Outcome reconstruct(const tilt_series::TiltSeries& tilt_series, const ReconstructOptions& options,
                    const ReconstructHooks& hooks) {
  const OutputPaths paths = output_paths(options.output);
  const PreparedSeries series =
      prepare_series(tilt_series, options.specimen, directory_of(paths.volume));
  const std::string fingerprint = fingerprint_of(options, series);
  const Measurement measurement = measurement_of(series);
  Fit fit(measurement, options.field, options.fit);
  if (options.resume) resume(paths, fingerprint, fit);

  const auto save_checkpoint = [&] {
    const field::TrainingState state = save_state(fit, fingerprint, /*with_moments=*/true);
    field::save_model(paths.model, fit.field(), model_info(series, options), &state);
  };
  const auto start = Clock::now();
  auto last_checkpoint = start;
  const std::int64_t first_step = fit.progress().step;
  bool stopped = false;
  fit.run([&](const Fit&) {
    if (hooks.progress) hooks.progress(progress_report(fit, first_step, start));
    stopped =
        hooks.stop_requested && hooks.stop_requested() && fit.progress().step < fit.num_steps();
    if (stopped || seconds_since(last_checkpoint) > 60 * options.checkpoint_minutes) {
      save_checkpoint();
      last_checkpoint = Clock::now();
    }
    return !stopped;
  });
  if (stopped) return Outcome::kStopped;
  write_results(fit, series, options, paths, fingerprint, seconds_since(start));
  return Outcome::kFinished;
}

}  // namespace tomofield::reconstruct
