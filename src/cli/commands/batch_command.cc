#include <fmt/format.h>
#include <fmt/ranges.h>

#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/log.h"
#include "base/progress.h"
#include "base/system/child_process.h"
#include "base/threads/parallel.h"
#include "batch/batch.h"
#include "batch/choice.h"
#include "batch/make_choice.h"
#include "batch/own_files.h"
#include "batch/run_jobs.h"
#include "batch/series_list.h"
#include "batch/slurm.h"
#include "batch/summary.h"
#include "batch/task.h"
#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/config_file.h"
#include "cli/options/help_formatter.h"
#include "cli/options/number_checks.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "io/is_file.h"
#include "io/lower_extension.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_folder.h"
#include "io/saving/output_lock.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

namespace fs = std::filesystem;
using option_table::Group;

constexpr double kGibibyte = 1 << 30;
constexpr int kMostSeries = 100'000;
constexpr int kUsualThreadsOfATask = 8;

struct BatchArguments {
  option_table::Choices choices;  // checked here, used by the runs
  std::string list, folder;
  bool skips_existing = false, overwrites = false, dry_run = false, slurm = false;
  int at_once = kMostSeries;
  batch::Choose choose = batch::Choose::kOnce;
  std::optional<int> task;
  std::optional<std::int64_t> began_ns;
  std::vector<std::string> sbatch;
};

// Says what a table may do with an option of reconstruct.
batch::ColumnKind kind_of_column(const CLI::App& reconstruct, const std::string& flag) {
  for (const char* own :
       {"--output", "--overwrite", "--resume", "--threads", "--dry-run", "--plan", "--choice",
        "--batch-choice", "--trace", "--grid", "--help", "--help-all"})
    if (flag == own) return batch::ColumnKind::kNotHere;
  const CLI::Option* option = reconstruct.get_option_no_throw(flag);
  if (option == nullptr) return batch::ColumnKind::kUnknown;
  return option->get_items_expected_max() == 0 ? batch::ColumnKind::kFlag
                                               : batch::ColumnKind::kWithValue;
}

// Returns what a table may do with the options of reconstruct.
batch::KnownColumns known_columns(const CLI::App& reconstruct) {
  batch::KnownColumns known{
      .kind_of = [&](const std::string& flag) { return kind_of_column(reconstruct, flag); },
      .names = {}};
  for (const CLI::Option* option : reconstruct.get_options())
    for (const std::string& name : option->get_lnames())
      if (known.kind_of("--" + name) != batch::ColumnKind::kNotHere) known.names.push_back(name);
  return known;
}

// Lets the options in the file of a cell `config` replace those of the command line. Adds those to
// `faults` that no table may set.
void read_config_cell(batch::Series& series, const batch::KnownColumns& known,
                      base::Faults& faults) {
  for (const option_table::GivenOption& option : series.options) {
    if (option.flag != "--config" || !option.value) continue;
    try {
      for (const std::string& name : names_in_config_file(*option.value)) {
        series.left_out.push_back("--" + name);
        if (known.kind_of("--" + name) == batch::ColumnKind::kNotHere)
          faults.add(fmt::format("{}: '{}' in '{}' is set by the batch: leave it out of the file",
                                 series.source, name, *option.value));
      }
    } catch (const Error& error) {
      faults.add(fmt::format("{}: {}", series.source, error.what()));
    }
  }
}

// Reads which series there are. Adds the mistakes of a table to `faults`.
std::vector<batch::Series> read_series(const CLI::App& program, const std::string& list,
                                       base::Faults& faults) {
  const bool is_pattern = !io::is_file(list) && list.find_first_of("*?[") != std::string::npos;
  const std::string ending = is_pattern ? "" : io::lower_extension(list);
  if (ending == ".star") return batch::read_star(list);
  if (ending != ".csv" && ending != ".tsv") return batch::expand_pattern(list);
  const batch::KnownColumns known = known_columns(*program.get_subcommand("reconstruct"));
  std::vector<batch::Series> all = batch::read_table(list, known, faults);
  for (batch::Series& series : all) read_config_cell(series, known, faults);
  return all;
}

// Returns the threads that all jobs share, or those of a task of a job array.
int threads_of(const CLI::App& command, const BatchArguments& arguments) {
  if (command.count("--threads") > 0) return base::thread_count();
  if (arguments.slurm) return kUsualThreadsOfATask;
  return batch::slurm_grant().threads.value_or(base::thread_count());
}

std::string time_or_unknown(const std::optional<double>& seconds) {
  return seconds ? base::time_text(*seconds) : "unknown";
}

void print_plan(const batch::JobList& list, const batch::Room& room) {
  std::int64_t results = 0;
  for (const batch::Job& job : list.jobs) {
    if (job.is_skipped) {
      print("{}: its results are there\n", job.name);
      continue;
    }
    const batch::Needs& needs = job.needs;
    results += needs.result_bytes;
    print("{}: {} of processor time, {:.2f} GiB of memory, {:.2f} GiB of results\n", job.name,
          time_or_unknown(needs.core_seconds),
          static_cast<double>(needs.memory_bytes_of_one_thread) / kGibibyte,
          static_cast<double>(needs.result_bytes) / kGibibyte);
  }
  const std::vector<std::size_t> waiting = largest_first(list.jobs);
  const std::optional<double> seconds = seconds_of_all(list.jobs, waiting, room);
  print(
      "{} of {} series to reconstruct, {:.2f} GiB of results; {} on {} threads if nothing else "
      "runs\n",
      waiting.size(), list.jobs.size(), static_cast<double>(results) / kGibibyte,
      seconds ? "about " + base::time_text(*seconds) : "an unknown time", room.threads);
  flush_output();
}

void print_choosing(const batch::JobList& list, const batch::ChoicePlan& plan) {
  const auto names_of = [&](const std::vector<std::size_t>& jobs) {
    std::vector<std::string> names;
    for (const std::size_t i : jobs) names.push_back(list.jobs[i].name);
    return fmt::format("{}", fmt::join(names, ", "));
  };
  if (plan.stored) print("for all series, as stored: {}\n", describe(*plan.stored));
  if (!plan.differing.empty())
    print("with the other settings that they began with: {}\n", names_of(plan.differing));
  if (!plan.choosing.empty())
    print("trials of {} choose the total variation of all series first\n", names_of(plan.choosing));
  if (plan.alone)
    print("{} alone is left to choose: its own trials choose its total variation\n",
          list.jobs[*plan.alone].name);
  flush_output();  // the choice comes before other output, in a file too
}

void print_summary(const fs::path& folder) {
  print("table     {}\npage      {}\n", batch::summary_table(folder).string(),
        batch::summary_page(folder).string());
}

batch::RunOptions run_options(const fs::path& folder) {
  return {.program = base::program_path(),
          .folder = folder,
          .stop_requested = stop_was_requested,
          .job_starts =
              [](const batch::Job& job, int threads) {
                base::log_info(fmt::format("{}: starts on {} {}", job.name, threads,
                                           threads == 1 ? "thread" : "threads"));
              },
          .job_ends =
              [](const batch::Job& job, const batch::State& state) {
                base::log_info(fmt::format("{}: {} after {}{}{}", job.name,
                                           base::name_of(state.progress),
                                           base::time_text(state.costs.wall_seconds),
                                           state.reason.empty() ? "" : ": ", state.reason));
              }};
}

// Chooses for all series by trials of some. Throws ExitStatus if it was stopped.
void choose_for_all(const batch::RunOptions& options, const std::vector<std::size_t>& choosing,
                    int threads, batch::JobList& list) {
  if (choosing.empty() || make_choice(options, choosing, threads, list)) return;
  throw ExitStatus(stop_status(), "stopped during the trials that choose for all series");
}

// Runs the jobs on this machine. Throws ExitStatus if some failed or it was stopped.
void run_here(const fs::path& folder, const batch::JobList& list, const batch::Room& room) {
  const bool is_finished = run_jobs(run_options(folder), list.jobs, room);
  print_summary(folder);
  if (!is_finished)
    throw ExitStatus(stop_status(), fmt::format("stopped; continue with the same command and "
                                                "--skip-existing{}",
                                                list.overwrites ? " instead of --overwrite" : ""));
  std::vector<std::string> failed;
  for (const batch::Job& job : list.jobs) {
    const batch::Progress progress = read_state(folder, job).progress;
    if (progress != batch::Progress::kDone && progress != batch::Progress::kSkipped)
      failed.push_back(job.name);
  }
  if (!failed.empty())
    throw ExitStatus(
        1, fmt::format("{} of {} series failed: {}; '{}' says why", failed.size(), list.jobs.size(),
                       fmt::join(failed, ", "), batch::summary_page(folder).string()));
}

// Returns the script of a job array. Throws Error for what cannot be submitted.
std::string script_for(const BatchArguments& arguments, const batch::JobList& list, int threads) {
  batch::require_sbatch();
  return slurm_script({.program = base::program_path(),
                       .folder = arguments.folder,
                       .threads = threads,
                       .began_ns = list.began_ns,
                       .more = arguments.sbatch},
                      list.jobs);
}

[[noreturn]] void throw_stopped_submission(const std::string& submitted) {
  throw ExitStatus(
      stop_status(),
      submitted.empty()
          ? "stopped; no job was submitted"
          : fmt::format("stopped; Slurm job {} was submitted before: scancel {} ends it", submitted,
                        submitted));
}

void run_by_slurm(const BatchArguments& arguments, const batch::JobList& list,
                  const std::string& script, bool chooses) {
  const fs::path folder = arguments.folder;
  if (batch::largest_first(list.jobs).empty()) return print_summary(folder);
  io::write_text_file(batch::script_of(folder), script);
  std::string choosing, job;
  try {
    if (chooses) choosing = batch::submit(folder, batch::kChoosingTask, "", stop_was_requested);
    job = batch::submit(folder, std::nullopt, choosing, stop_was_requested);
  } catch (const base::StopRequested&) {
    throw_stopped_submission(choosing);
  } catch (const Error& error) {
    if (choosing.empty()) throw;
    throw Error(
        fmt::format("{}; Slurm job {}, which chooses for all series, was submitted before: "
                    "scancel {} ends it",
                    error.what(), choosing, choosing));
  }
  if (stop_was_requested()) throw_stopped_submission(job);
  print("script    {}\nSlurm job {}{}\n", batch::script_of(folder).string(), job,
        chooses ? fmt::format(", after {}, which chooses for all series", choosing) : "");
  print_summary(folder);
}

void run_task(const CLI::App& command, const BatchArguments& arguments) {
  stop_on_signals(/*is_job=*/true);  // Slurm sends SIGUSR1 before the time limit
  batch::JobList list = batch::read_jobs(arguments.list);
  require_same_batch(arguments.list, list, arguments.began_ns);
  const batch::RunOptions options = run_options(arguments.folder);
  const int threads = threads_of(command, arguments);
  if (*arguments.task == batch::kChoosingTask) {
    const auto plan = batch::plan_choice(arguments.folder, /*continues=*/false, list.jobs);
    return choose_for_all(options, plan.choosing, threads, list);
  }
  if (*arguments.task > 0 && list.chooses && !batch::read_choice(arguments.folder))
    base::log_warning(
        "the task that chooses for all series has not made its choice: this series chooses for "
        "itself, and the batch with --overwrite makes a common choice");
  const auto time_is_up = [] { return stop_was_requested() && stop_status() == 128 + SIGUSR1; };
  const batch::TaskResult result = run_task(options, list, *arguments.task, threads, time_is_up);
  base::log_info(fmt::format("{}{}{}", base::name_of(result.state.progress),
                             result.state.reason.empty() ? "" : ": ", result.state.reason));
  if (result.state.progress == batch::Progress::kFailed) throw ExitStatus(1, result.state.reason);
  if (result.state.progress == batch::Progress::kStopped && result.continued_by.empty())
    throw ExitStatus(stop_status(), result.state.reason.empty() ? "stopped" : result.state.reason);
}

void run(const CLI::App& command, const BatchArguments& arguments,
         const std::vector<std::string>& own_options) {
  if (arguments.task) return run_task(command, arguments);
  stop_on_signals();
  batch::PlanOptions options{.program = base::program_path(),
                             .list = arguments.list,
                             .folder = arguments.folder,
                             .common = given_options(command, own_options),
                             .threads = threads_of(command, arguments),
                             .skips_existing = arguments.skips_existing,
                             .overwrites = arguments.overwrites,
                             .stop_requested = stop_was_requested};
  base::Faults faults;
  std::vector<batch::Series> series = read_series(*command.get_parent(), arguments.list, faults);
  settle_outputs(series, options, faults);
  batch::require_none(faults);
  const io::OutputFolder folder(options.folder);
  const io::OutputLock lock(batch::list_of(options.folder));
  batch::JobList list = plan_jobs(series, options);
  batch::require_own_files(list.jobs, options);
  if (stop_was_requested())
    throw ExitStatus(stop_status(), "stopped before the first series; nothing has been made");
  const batch::Room room{.threads = options.threads,
                         .memory_bytes = batch::memory_for_jobs(),
                         .jobs = arguments.at_once};
  if (!arguments.slurm) require_room(list.jobs, room);
  print_plan(list, room);
  batch::ChoicePlan choice;
  if (arguments.choose == batch::Choose::kOnce)
    choice = batch::plan_choice(options.folder, options.skips_existing, list.jobs);
  list.chooses = !choice.choosing.empty();
  print_choosing(list, choice);
  require_words(list);
  const std::string script =
      arguments.slurm && !arguments.dry_run ? script_for(arguments, list, options.threads) : "";
  if (arguments.dry_run) return;
  if (choice.stored)
    give_choice(*choice.stored, options.folder, list.jobs);
  else if (arguments.choose == batch::Choose::kOnce || !options.skips_existing)
    batch::forget_choice(options.folder);
  begin_batch(options.folder, list);
  if (arguments.slurm) return run_by_slurm(arguments, list, script, !choice.choosing.empty());
  choose_for_all(run_options(options.folder), choice.choosing, options.threads, list);
  run_here(options.folder, list, room);
}

void add_slurm_options(CLI::App& command, BatchArguments& arguments) {
  const char* group = "Slurm";
  CLI::Option* slurm =
      command
          .add_flag("--slurm", arguments.slurm,
                    "Submit a job array to Slurm, with a task for every series; a task that comes "
                    "near its time limit saves a checkpoint and submits itself again")
          ->group(group);
  command
      .add_option("--sbatch", arguments.sbatch,
                  "Options of sbatch, as in '--partition=cpu --time=4:00:00'; may be repeated")
      ->type_name("OPTIONS")
      ->allow_extra_args(false)
      ->needs(slurm)
      ->check(CLI::Validator(
          [](const std::string& text) -> std::string {
            return text.find_first_of("\n\r") == std::string::npos ? "" : "must be one line";
          },
          ""))
      ->group(group);
  command
      .add_option("--began", arguments.began_ns,
                  "With --task: when the batch began whose list it is, as batch.json states it")
      ->group(kHelpAllGroup);
  command
      .add_option("--task", arguments.task,
                  "Run one series of the list batch.json, from 1; 0 chooses for all series")
      ->check(number_between(0, kMostSeries))
      ->group(kHelpAllGroup);
}

std::vector<std::string> add_own_options(CLI::App& command, BatchArguments& arguments) {
  const char* group = "Batch";
  command
      .add_option(
          "LIST", arguments.list,
          "A table of the series (.csv, .tsv) with columns 'stack' and options of reconstruct, "
          "RELION's tomograms.star, or a pattern in quotes, as in 'data/*.mrc'")
      ->required();
  command.add_option("-o,--output", arguments.folder, "Folder of the results and of the summary")
      ->required()
      ->type_name("FOLDER")
      ->group(group);
  CLI::Option* skip = command
                          .add_flag("--skip-existing,--resume", arguments.skips_existing,
                                    "Leave finished series as they are, and continue others from "
                                    "their checkpoints")
                          ->group(group);
  command.add_flag("--overwrite", arguments.overwrites, "Replace existing results")
      ->excludes(skip)
      ->group(group);
  command
      .add_flag("--dry-run", arguments.dry_run,
                "Check all series and print the memory, time and disk that they need")
      ->group(group);
  command.add_option("--at-once", arguments.at_once, "Most series that run side by side")
      ->check(number_between(1, kMostSeries))
      ->default_str("as many as the threads and the memory allow")
      ->group(group);
  add_enum_option<batch::Choose>(
      command, "--choose", arguments.choose,
      "Choose the kind and the weight of total variation, and the limit of spikes, once for all "
      "series, by trials of three of them, or let each series choose for itself")
      ->default_str("once")
      ->group(group);
  add_slurm_options(command, arguments);
  return {"LIST",      "--output",  "--skip-existing", "--resume", "--overwrite",
          "--dry-run", "--at-once", "--choose",        "--slurm",  "--sbatch",
          "--began",   "--task",    "--threads"};
}

}  // namespace

void add_batch_command(CLI::App& program) {
  CLI::App& command = *program.add_subcommand(
      "batch", "Reconstruct many series, with a summary of all; failures do not stop the others");
  auto arguments = std::make_shared<BatchArguments>();
  const auto own_options = add_own_options(command, *arguments);
  add_project_options(command);
  add_series_options(command, arguments->choices);
  add_groups(command, arguments->choices,
             {Group::kTransfer, Group::kSpecimen, Group::kField, Group::kFit, Group::kVolume,
              Group::kHalves});
  for (const char* key : {"running.checkpoint_minutes", "running.alignment_json"})
    add_row(command, key, arguments->choices);
  add_groups(command, arguments->choices, {Group::kResearch});
  for (CLI::Option* option : command.get_options()) {  // a table may have what a series needs
    const bool is_required_of_a_run = row_of_option(*option) != nullptr && option->get_required();
    if (is_required_of_a_run) option->required(false)->default_str("");
  }
  add_common_options(command);
  add_help_all(command);
  command.footer(
      "Options of reconstruct hold for all series; a table may have a column for each of them.\n"
      "Example: tomofield batch 'data/*.mrc' --tlt '{folder}/{name}.tlt' --bin 4 -o results");
  command.callback([&command, arguments, own_options] { run(command, *arguments, own_options); });
}

}  // namespace tomofield::cli
