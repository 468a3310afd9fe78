#include "cli/commands/run_reconstruction.h"

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/threads/parallel.h"
#include "cli/commands/plan_file.h"
#include "cli/options/fit_options.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "cli/terminal/progress_bar.h"
#include "exchange/alignment_output.h"
#include "exchange/exchange_files.h"
#include "output/output_paths.h"
#include "output/volume.h"
#include "plan/plan.h"
#include "reconstruct/reconstruct.h"
#include "reconstruct/run_files.h"
#include "tomofield/error.h"
#include "verdict/verdict.h"

namespace tomofield::cli {
namespace {

// Returns a callback for a process that waits for others. After a signal, it tells the user that
// they do not answer: one may have died, and then mpirun stops the rest.
std::function<void()> tell_if_stuck(const std::filesystem::path& model,
                                    const distributed::Communicator& processes) {
  constexpr double kSecondsToAnswer = 0.4;
  auto since = std::make_shared<std::optional<base::Stopwatch>>();
  auto is_told = std::make_shared<bool>(!processes.is_root());
  return [=] {
    if (!stop_was_requested() || *is_told) return;
    if (!*since) since->emplace();
    if ((*since)->seconds() < kSecondsToAnswer) return;
    *is_told = true;
    say("tomofield: asked to stop, but other processes do not answer yet; if one of them "
        "died, {}\n",
        std::filesystem::exists(model)
            ? fmt::format("continue from '{}' with --resume", model.string())
            : "there is no checkpoint yet");
  };
}

std::string epochs_text(const std::vector<fit::Stage>& stages) {
  std::vector<std::string> texts;
  for (const fit::Stage& stage : stages) {
    const char* of_vertices =
        stage.field_kind == stages.back().field_kind ? "" : " with plain vertices";
    texts.push_back(stage.bin == 1
                        ? fmt::format("{} at full resolution{}", stage.epochs, of_vertices)
                        : fmt::format("{} of pixels {} x {}{}", stage.epochs, stage.bin, stage.bin,
                                      of_vertices));
  }
  return fmt::format("{}", fmt::join(texts, ", "));
}

Sizes sizes_of(const plan::RunPlan& plan, const options::ReconstructOptions& options) {
  return {plan.num_views, plan.view_width, plan.view_height,   plan.pixel_size_A,
          plan.roi,       plan.thickness,  options.volume.axes};
}

void print_plan(const options::ReconstructOptions& options, const plan::RunPlan& plan,
                int num_processes) {
  print_sizes(sizes_of(plan, options));
  if (plan.num_trials > 0)
    print("about {} short trials first, that choose settings by held-out views\n", plan.num_trials);
  const std::string processes =
      num_processes == 1 ? "" : fmt::format(" of each of {} processes", num_processes);
  print("{} field, {} {}, {} parameters; {} steps on {}{}; about {:.2f} GiB of memory{}\n",
        base::name_of(*options.field.kind), plan.num_leaves,
        plan.num_leaves == 1 ? "leaf" : "leaves", plan.num_parameters, plan.num_steps,
        count_of(base::thread_count(), "thread"), processes,
        static_cast<double>(plan.memory_bytes) / (1 << 30), num_processes == 1 ? "" : " each");
  print("epochs: {}\n", epochs_text(plan.stages));
  if (plan.tiles.is_used()) {
    print(
        "tiles: {} of {} rows, which are made compact one after the other; {} of the stages for "
        "the whole region before them\n",
        plan.tiles.tiles_from(0).size(), plan.tiles.rows, plan.tiles.num_whole_stages);
  }
  if (options.makes_halves())
    print("halves: two fits more, of one half of the {} each, after that of all data\n",
          options.fit.split_tilts ? "tilts" : "frames");
  flush_output();  // the plan comes before other output, in a file too
}

void print_files_of_halves(const output::OutputPaths& paths, bool with_linear_volumes) {
  for (const output::OutputPaths::OfHalf& half : paths.halves) {
    print("half      {}, model {}\n", half.volume.string(), half.model.string());
    if (with_linear_volumes) print("linear    {}\n", half.linear_volume.string());
  }
  print("maps      {} {}\nFSC       {}\n", paths.local_resolution.string(),
        paths.uncertainty.string(), paths.fsc_picture.string());
}

void print_files(const options::ReconstructOptions& options, const output::OutputPaths& paths) {
  print("tomogram  {}\nmodel     {}\nmetrics   {}\nreport    {}\n", paths.volume.string(),
        paths.model.string(), paths.json.string(), paths.report.string());
  if (options.makes_halves()) print_files_of_halves(paths, options.fit.denoising_halves);
}

ExitStatus stopped(const char* what_is_there, const std::filesystem::path& file,
                   const options::ReconstructOptions& options, bool leaves_trace) {
  return {stop_status(),
          fmt::format("stopped; {} '{}': continue with the same command and --resume{}{}",
                      what_is_there, file.string(),
                      options.run.overwrite ? " instead of --overwrite" : "",
                      leaves_trace ? ", and another name for --trace" : "")};
}

// Throws the ExitStatus of a run that was stopped.
void require_finished(const reconstruction::RunResult& run,
                      const options::ReconstructOptions& options, const output::OutputPaths& paths,
                      bool leaves_trace) {
  switch (run.outcome) {
    case reconstruction::Outcome::kFinished:
      return;
    case reconstruction::Outcome::kStopped:
      throw stopped("the checkpoint is", run.checkpoint, options, leaves_trace);
    case reconstruction::Outcome::kStoppedTuning:
      if (options.fit.tune && std::filesystem::exists(paths.trials))
        throw stopped("the finished trials are in", paths.trials, options, leaves_trace);
      if (std::filesystem::exists(paths.alignment) && options.run.align != Alignment::kOff)
        throw stopped("the alignment is in", paths.alignment, options, leaves_trace);
      throw ExitStatus{stop_status(), "stopped before the first checkpoint"};
    case reconstruction::Outcome::kStoppedAligning:
      throw_stopped_alignment();
  }
}

void warn_of_unused_rank(const options::ReconstructOptions& options) {
  if (options.field.kind == FieldKind::kGrid && !options.field.rank.is_left_to_trials())
    base::log_warning(
        "--rank changes nothing: it is for factors (--field vm), and this field has plain "
        "vertices");
}

void print_results(const reconstruction::RunResult& run, const options::ReconstructOptions& options,
                   const output::OutputPaths& paths) {
  print_files(options, paths);
  for (const auto& file : exchange::volume_descriptions(options))
    print("exchange  {}\n", file.string());
  print_alignment(options);
  if (options.volume.zarr) print("OME-Zarr  {}\n", output::zarr_path(paths.volume).string());
  print_pictures(run.pictures);
  if (options.field.tree == TreeKind::kAdaptive)
    print("tree      {}\n", paths.tree_picture.string());
  flush_output();  // the verdict comes last
  verdict::log_verdict(run.record.fit.verdict);
}

}  // namespace

void add_run_options(CLI::App& command, option_table::Choices& choices, DryRun& dry_run) {
  add_groups(command, choices, {option_table::Group::kRun});
  command.get_option("--resume")->excludes("--overwrite");
  command
      .add_flag("--dry-run", dry_run.is_wanted,
                "Check everything, and print the plan with its memory, time and disk")
      ->group(std::string(title_of(option_table::Group::kRun)));
  add_grid_option(command, dry_run.grid);
}

reconstruction::Observer terminal_observer(const distributed::Communicator& processes) {
  reconstruction::Observer observer;
  observer.stop_requested = stop_was_requested;
  if (!processes.is_root()) return observer;
  observer.alignment = make_progress_bar("align");
  observer.trials = make_progress_bar("tune");
  observer.fit = make_progress_bar("reconstruct");
  return observer;
}

void throw_stopped_alignment() { throw ExitStatus{stop_status(), "stopped during the alignment"}; }

void print_pictures(const std::vector<std::filesystem::path>& pictures) {
  print("pictures ");
  for (const std::filesystem::path& picture : pictures) print(" {}", picture.string());
  print("\n");
}

void print_alignment(const options::ReconstructOptions& options) {
  if (options.run.align == Alignment::kOff) return;
  print("alignment {}\n", output::output_paths(options.run.output).alignment.string());
  for (const auto& file : exchange::alignment_results(options))
    if (std::filesystem::exists(file)) print("          {}\n", file.string());
}

void run_reconstruction(const options::ReconstructOptions& options, const DryRun& dry_run,
                        bool leaves_trace, const distributed::Communicator& processes) {
  if (options.run.output.empty()) throw Error("-o '' names no file: name the tomogram");
  const auto show_plan = [&](const plan::RunPlan& plan) {
    warn_of_unused_rank(options);
    print_plan(options, plan, processes.size());
  };
  if (dry_run.is_wanted) {
    const reconstruction::Preview preview = reconstruction::preview(options, processes);
    show_plan(preview.plan);
    if (!processes.is_root()) return;
    print_estimate(preview.estimate, processes.size());
    if (dry_run.grid)
      write_grid(*dry_run.grid, sizes_of(preview.plan, options),
                 reconstruction::replaceable_files(options));
    return;
  }
  const output::OutputPaths paths = output::output_paths(options.run.output);
  const bool is_job = processes.size() > 1;
  stop_on_signals(is_job);
  if (is_job) processes.set_waiting_callback(tell_if_stuck(paths.model, processes));
  reconstruction::Observer observer = terminal_observer(processes);
  observer.planned = show_plan;
  const reconstruction::RunResult run = reconstruction::run(options, observer, processes);
  require_finished(run, options, paths, leaves_trace);
  if (processes.is_root()) print_results(run, options, paths);
}

}  // namespace tomofield::cli
