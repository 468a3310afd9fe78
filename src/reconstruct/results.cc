#include "reconstruct/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "base/range.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "checkpoint/checkpoint.h"
#include "compact/budget.h"
#include "compact/compress.h"
#include "evaluate/artefacts.h"
#include "evaluate/evaluation_record.h"
#include "io/json.h"
#include "io/saving/output_set.h"
#include "option_table/setting.h"
#include "options/run_options.h"
#include "output/metrics_record.h"
#include "output/output_paths.h"
#include "output/volume.h"
#include "reconstruct/run_files.h"
#include "reconstruct/run_pages.h"
#include "report/choice_plot.h"
#include "report/pictures.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"
#include "verdict/judge.h"
#include "verdict/verdict_record.h"

namespace tomofield::reconstruction {
namespace {

// Returns the held-out view nearest to zero tilt.
measurement::PredictedView view_near_zero(const fit::Fit& fit,
                                          const measurement::Measurement& series,
                                          const measurement::ViewErrors& error) {
  const auto nearest = std::ranges::min_element(error.views, {}, [&](int view) {
    return std::abs(series.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  });
  const auto model = error.models[static_cast<std::size_t>(nearest - error.views.begin())];
  return fit.predict(std::span(&*nearest, 1), std::span(&model, 1)).front();
}

nlohmann::json held_out_json(const fit::Fit& fit, const measurement::Measurement& series,
                             const options::ReconstructOptions& options,
                             const std::optional<measurement::ViewErrors>& errors) {
  if (!errors) return nullptr;
  nlohmann::json json =
      output::report_held_out(*errors, series.geometry.tilt_deg, options.fit.patience > 0);
  json["error_by_epoch"] = fit.progress().held_out_error;
  return json;
}

// Returns the rows of the volume that this process works on. The views as recorded of a process
// that is alone may have other rows.
base::Range own_rows(const fit::Fit& fit, const measurement::Measurement& series) {
  const auto num_rows = static_cast<int>(series.roi.height());
  if (fit.processes().size() == 1) return {0, num_rows};
  const base::Range slabs = series.rays->own();
  return {slabs.begin * kernels::kLanes, std::min(slabs.end * kernels::kLanes, num_rows)};
}

// Returns the rows and the parameters that this process contributes to the volume.
output::VolumeShare volume_share(const fit::Fit& fit, const measurement::Measurement& series) {
  const base::Range leaves = fit.own_leaves();
  return {fit.processes(), own_rows(fit, series), fit.field().offset(leaves.begin),
          fit.field().offset(leaves.end)};
}

using Writers = std::vector<std::function<void()>>;

// Calls all writers. They work at the same time if this process is alone; several processes talk to
// each other in them. Throws what the first of those that fail throws.
void write_all(const Writers& writers, const distributed::Communicator& processes) {
  if (processes.size() > 1) {
    for (const auto& write : writers) write();
    return;
  }
  std::vector<std::exception_ptr> failures(writers.size());
  base::parallel_for("write results", std::ssize(writers), [&](std::int64_t i) {
    try {
      writers[static_cast<std::size_t>(i)]();
    } catch (...) {
      failures[static_cast<std::size_t>(i)] = std::current_exception();
    }
  });
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

// Writes the results of a fit into files.
void write_results(RunResult& results, const ResultFiles& files) {
  const std::optional<tune::TunedFit>& tuned = files.origin.tuned;
  const output::OutputPaths& paths = files.run.paths;
  const distributed::Communicator& processes = files.share.processes;
  Writers writers;
  if (processes.size() == 1) {
    writers.push_back([&] { output::save_model(paths.model, *results.model, &files.state); });
  }
  writers.push_back([&] {
    output::write_volume(*results.model, files.run.options.volume, paths.volume, files.share);
  });
  if (files.held_out_view) {
    writers.push_back([&] {
      processes.run_collectively([&] {
        if (processes.is_root())
          report::write_held_out_picture(*files.held_out_view, paths.held_out_picture);
      });
    });
  }
  if (tuned) {
    writers.push_back([&] {
      processes.run_collectively([&] {
        if (processes.is_root()) report::write_choice_plot(*tuned, paths.choice_picture);
      });
    });
  }
  write_all(writers, processes);
  processes.run_collectively([&] {
    if (processes.is_root()) io::write_json(paths.json, results.metrics);
  });
}

// Puts the model of a run in place whose results cannot be written together: a finished fit is not
// lost. `save_again` writes the model if it did not get onto the disk beside the other results.
// Throws the exception that is being handled, and adds what the user can do.
[[noreturn]] void keep_model(const std::filesystem::path& model, io::OutputSet& outputs,
                             const std::function<void()>& save_again) {
  bool is_kept = false;
  try {
    is_kept = outputs.commit_only(model);
    if (!is_kept && save_again) {
      save_again();
      is_kept = outputs.commit_only(model);
    }
  } catch (const Error&) {  // the first failure says more
  }
  if (!is_kept) throw;
  const std::string advice = fmt::format(
      "; the finished fit is kept in '{}': the same command with --resume writes the results",
      model.string());
  try {
    throw;
  } catch (const distributed::SharedError& error) {
    throw distributed::SharedError(error.what() + advice);
  } catch (const Error& error) {
    throw Error(error.what() + advice);
  }
}

// Does the same for a compact model, which is no checkpoint.
[[noreturn]] void keep_compact_model(const std::filesystem::path& model, io::OutputSet& outputs) {
  bool is_kept = false;
  try {
    is_kept = outputs.commit_only(model);
  } catch (const Error&) {  // the first failure says more
  }
  if (!is_kept) throw;
  try {
    throw;
  } catch (const Error& error) {
    throw Error(
        fmt::format("{}; the compact model is kept in '{}': tomofield export writes its "
                    "volume",
                    error.what(), model.string()));
  }
}

// Replaces the model of the results by a compact one.
void make_compact(const compact::Budget& budget, RunResult& results) {
  const base::Stopwatch running;
  const output::Model& model = *results.model;
  compact::CompactField made = compact::compress(
      *model.field, model.roi, budget,
      [&](const compact::CodedField& coded) { return output::coded_file_size(coded, model); });
  results.model->field = std::move(made.field);
  results.model->coded = std::move(made.coded);
  results.metrics["metrics"]["compact"] = output::compact_json(made.report, running.seconds());
}

// Does the same. If that fails, keeps the finished fit.
void make_compact_or_keep(const ResultFiles& files, std::optional<io::OutputSet>& outputs,
                          RunResult& results) {
  const std::filesystem::path& model = files.run.paths.model;
  try {
    make_compact(compact::parse_budget(files.run.options.field.budget), results);
  } catch (const Error&) {
    if (!outputs) throw;
    keep_model(model, *outputs, [&] { output::save_model(model, *results.model, &files.state); });
  }
}

}  // namespace

Examination examine(const fit::Fit& fit, const measurement::Measurement& measured, const Run& run,
                    const FitRecord& record) {
  Examination found;
  found.metrics = output::metrics_json(fit, measured, record.seconds);
  found.metrics["tv_weight"] = *options::with_denoise(run.options.fit).density_variation;
  if (run.options.fit.hold_out > 0) {
    const base::TraceSpan span("score held-out views");
    found.held_out = fit.held_out_error();
  }
  found.metrics["held_out"] = held_out_json(fit, measured, run.options, found.held_out);
  found.metrics["processes"] = output::processes_json(fit, record.seconds);
  const std::optional<tune::TunedFit>& tuned = record.origin.tuned;
  found.verdict = verdict::judge(
      {fit, measured, run.options, tuned, run.alignment, volume_share(fit, measured).rows},
      found.held_out);
  found.metrics.update(
      evaluate::artefacts_json(found.verdict.artefacts.speckle, found.verdict.artefacts.faces));
  found.metrics["verdict"] = verdict::verdict_json(found.verdict);
  found.metrics["alignment"] =
      run.options.alignment ? alignment::to_json(*run.options.alignment) : nlohmann::json(nullptr);
  found.metrics["tuning"] = tuned ? tune::tuning_json(*tuned) : nlohmann::json(nullptr);
  return found;
}

std::optional<measurement::PredictedView> central_held_out_view(
    const fit::Fit& fit, const measurement::Measurement& measured, const Examination& found) {
  if (!found.held_out) return std::nullopt;
  return view_near_zero(fit, measured, *found.held_out);
}

nlohmann::json run_json(const options::ReconstructOptions& options, nlohmann::json metrics) {
  return {{"tomofield", TOMOFIELD_VERSION},
          {"options", options::options_json(options)},
          {"origins", option_table::settings_json(options.settings)},
          {"metrics", std::move(metrics)}};
}

RunResult finish(fit::Fit& fit, const Run& run, const FitRecord& record) {
  const measurement::Measurement& measured = run.measurement;
  const checkpoint::FitOrigin& origin = record.origin;
  fit.free_optimizer();  // the verdict and a compact model need the memory
  Examination found = examine(fit, measured, run, record);
  std::optional<measurement::PredictedView> view;
  if (run.writes_files()) view = central_held_out_view(fit, measured, found);
  const output::VolumeShare share = volume_share(fit, measured);
  const output::ModelInfo info = checkpoint::model_info(measured, run.options);
  const output::TrainingState state = checkpoint::progress_state(fit, origin);
  std::optional<io::OutputSet> outputs;
  if (run.writes_files()) outputs.emplace();
  if (run.writes_files() && run.processes.size() > 1)
    checkpoint::save_fit(run.paths.model, fit, info, state);
  RunResult result{.model = output::Model{info, fit.take_field(), std::nullopt},
                   .metrics = run_json(run.options, std::move(found.metrics)),
                   .verdict = std::move(found.verdict),
                   .bead_masking = measured.masks.bead_masking};
  const ResultFiles files{run, origin, state, share, view};
  if (!run.options.field.budget.empty()) make_compact_or_keep(files, outputs, result);
  if (run.writes_files()) write_together(files, *outputs, result);
  return result;
}

void write_together(const ResultFiles& files, io::OutputSet& outputs, RunResult& results) {
  const distributed::Communicator& processes = files.share.processes;
  const output::OutputPaths& paths = files.run.paths;
  try {
    write_results(results, files);
    processes.run_collectively([&] {
      if (!processes.is_root()) return;
      write_pages(files.run, outputs, results);
      remove_stale_files(files.run.options, outputs);
      outputs.commit();
    });
  } catch (...) {
    if (results.model->coded) keep_compact_model(paths.model, outputs);
    std::function<void()> save_again;  // several processes have saved theirs together
    if (processes.size() == 1)
      save_again = [&] { output::save_model(paths.model, *results.model, &files.state); };
    keep_model(paths.model, outputs, save_again);
  }
}

}  // namespace tomofield::reconstruction
