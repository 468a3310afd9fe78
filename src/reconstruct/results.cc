#include "reconstruct/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/progress.h"
#include "base/range.h"
#include "base/threads/parallel.h"
#include "base/threads/stoppable_loops.h"
#include "base/trace.h"
#include "checkpoint/checkpoint.h"
#include "compact/budget.h"
#include "compact/compress.h"
#include "io/saving/output_set.h"
#include "options/options_record.h"
#include "output/metrics_record.h"
#include "output/output_paths.h"
#include "output/volume.h"
#include "reconstruct/run_files.h"
#include "reconstruct/run_pages.h"
#include "report/choice_plot.h"
#include "report/pictures.h"
#include "tomofield/error.h"
#include "verdict/judge.h"

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
    if (processes.is_root()) record::write_record(paths.json, results.record);
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
  throw_with(fmt::format(
      "; the finished fit is kept in '{}': --resume writes the results without another fit",
      model.string()));
}

// Does the same for a compact model, which is no checkpoint.
[[noreturn]] void keep_compact_model(const std::filesystem::path& model, io::OutputSet& outputs) {
  bool is_kept = false;
  try {
    is_kept = outputs.commit_only(model);
  } catch (const Error&) {  // the first failure says more
  }
  if (!is_kept) throw;
  throw_with(fmt::format("; the compact model is kept in '{}': tomofield export writes its volume",
                         model.string()));
}

// Replaces the model of the results by a compact one. Throws base::StopRequested if a stop is asked
// for.
void make_compact(const compact::Budget& budget, const std::function<bool()>& is_asked,
                  RunResult& results) {
  const base::Stopwatch running;
  const base::StoppableLoops loops(is_asked);
  const output::Model& model = *results.model;
  compact::CompactField made = compact::compress(
      *model.field, model.roi, budget,
      [&](const compact::CodedField& coded) { return output::coded_file_size(coded, model); });
  results.model->field = std::move(made.field);
  results.model->coded = std::move(made.coded);
  results.record.compact = record::CompactRecord{made.report, running.seconds()};
}

// Does the same. If that fails or is stopped, keeps the finished fit.
void make_compact_or_keep(const ResultFiles& files, std::optional<io::OutputSet>& outputs,
                          RunResult& results) {
  const std::filesystem::path& model = files.run.paths.model;
  // Several processes cannot leave a loop together.
  const auto is_asked = files.share.processes.size() == 1 ? files.run.observer.stop_requested
                                                          : std::function<bool()>();
  try {
    make_compact(compact::parse_budget(files.run.options.field.budget), is_asked, results);
  } catch (...) {
    if (!outputs) throw;
    keep_model(model, *outputs, [&] { output::save_model(model, *results.model, &files.state); });
  }
}

}  // namespace

void throw_with(const std::string& advice) {
  try {
    throw;
  } catch (const distributed::SharedError& error) {
    throw distributed::SharedError(error.what() + advice);
  } catch (const Error& error) {
    throw Error(error.what() + advice);
  }
}

record::FitRecord examine(const fit::Fit& fit, const measurement::Measurement& measured,
                          const Run& run, const FitOutcome& outcome) {
  const options::ReconstructOptions& options = run.options;
  record::FitRecord found{
      .metrics = record::fit_metrics(
          fit, measured, *options::with_denoise(options.fit).density_variation, outcome.seconds),
      .verdict = {},
      .alignment = options.alignment,
      .tuned = outcome.origin.tuned};
  std::optional<measurement::ViewErrors> held_out;
  if (options.fit.hold_out > 0) {
    const base::TraceSpan span("score held-out views");
    held_out = fit.held_out_error();
    output::log_held_out(*held_out, options.fit.patience > 0);
    found.metrics.held_out =
        record::HeldOutMetrics{*held_out, options.fit.patience > 0, fit.progress().held_out_error};
  }
  found.verdict = verdict::judge(
      {fit, measured, options, found.tuned, run.alignment, volume_share(fit, measured).rows},
      held_out);
  return found;
}

std::optional<measurement::PredictedView> central_held_out_view(
    const fit::Fit& fit, const measurement::Measurement& measured, const record::FitRecord& found) {
  if (!found.metrics.held_out) return std::nullopt;
  return view_near_zero(fit, measured, found.metrics.held_out->errors);
}

record::RunRecord run_record(const options::ReconstructOptions& options, record::FitRecord fit) {
  return {.options = options::options_json(options),
          .settings = options.settings,
          .fit = std::move(fit)};
}

RunResult finish(fit::Fit& fit, const Run& run, const FitOutcome& outcome) {
  const measurement::Measurement& measured = run.measurement;
  const checkpoint::FitOrigin& origin = outcome.origin;
  run.processes.run_collectively([&] { output::require_converged(fit.field()); });
  fit.free_optimizer();  // the verdict and a compact model need the memory
  record::FitRecord found = examine(fit, measured, run, outcome);
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
                   .record = run_record(run.options, std::move(found))};
  const ResultFiles files{run, origin, state, share, view};
  try {
    if (!run.options.field.budget.empty()) make_compact_or_keep(files, outputs, result);
  } catch (const base::StopRequested&) {
    return {.outcome = Outcome::kStopped, .checkpoint = run.paths.model};
  }
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
