#include "compare/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "base/log.h"
#include "compare/grid.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kState = ".row.json";

// Returns the files of the run, and those in which the comparison keeps its state and all that it
// said.
output::OutputPaths paths_of(const Row& row) { return output::output_paths(row.volume); }
fs::path state_of(const Row& row) { return fs::path(row.volume).replace_extension(kState); }
fs::path log_of(const Row& row) { return fs::path(row.volume).replace_extension(".log"); }

// Returns true if there is a checkpoint, or trials of a tuning that was stopped.
bool can_resume(const Row& row) {
  if (!row.run.method.resumes) return false;
  return fs::exists(paths_of(row).model) ||
         (row.state.progress != Progress::kFinished && fs::exists(paths_of(row).trials));
}

// Returns the costs of earlier sessions that count towards the costs of a run.
base::Costs costs_until_now(const Row& row) {
  if (!can_resume(row)) return {};
  if (row.state.progress != Progress::kStopped) {
    base::log_warning(fmt::format(
        "{} goes on from a run that was killed: what that had taken since it was started is not "
        "known, and is missing in its core-seconds and time",
        row.run.name));
  }
  return row.state.costs;
}

// Returns what the JSON file of a finished run says.
record::RunSummary summary_of(const Row& row) {
  const fs::path file = paths_of(row).json;
  try {
    return record::read_summary(file);
  } catch (const Error& fault) {
    throw Error(not_of_this_comparison(file, fault.what()));
  }
}

// Runs one method. Returns false if it was stopped.
bool run(const fs::path& program, const RunHooks& hooks, Row& row) {
  const fs::path log = log_of(row);
  const std::vector<std::string> command = full_command(program, row, row.volume);
  // The fit is finished; only the volume is written again.
  const bool is_paid = can_resume(row) && row.state.progress == Progress::kFinished;
  const auto keep = [&](Progress progress, const base::Costs& costs) {
    if (is_paid) return;
    row.state = {progress, costs};
    write_row(state_of(row), row.origin, row.state);
  };
  const base::Costs before = is_paid ? row.state.costs : costs_until_now(row);
  keep(Progress::kRunning, before);
  const base::ChildResult result = base::run_child(command, log, hooks.stop_requested);
  const bool has_ended = result.exit_status == 0;
  keep(has_ended ? Progress::kFinished : Progress::kStopped, before + result.costs);
  if (has_ended || hooks.must_stop()) return has_ended;
  throw Error(fmt::format("{} failed with status {}: {} (all that it said is in '{}')",
                          row.run.name, result.exit_status,
                          base::reason_of_failure(result.exit_status, log), log.string()));
}

}  // namespace

std::vector<Row> new_rows(const std::vector<Run>& runs, const fs::path& folder) {
  std::vector<Row> rows;
  for (const Run& run : runs) {
    rows.push_back({.run = run,
                    .volume = folder / (run.name + ".mrc"),
                    .origin = origin_of(run.command, run.inputs),
                    .state = {}});
  }
  return rows;
}

std::vector<Row> stored_rows(const std::vector<Run>& runs, const fs::path& folder) {
  std::vector<Row> rows = new_rows(runs, folder);
  for (Row& row : rows) row.state = read_row(state_of(row), row.origin);
  return rows;
}

void claim_rows(std::vector<Row>& rows) {
  for (Row& row : rows) {
    row.state = {.progress = Progress::kStopped, .costs = {}};
    write_row(state_of(row), row.origin, row.state);
  }
}

std::string run_of_state(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.ends_with(kState) ? name.substr(0, name.size() - kState.size()) : "";
}

bool is_done(const Row& row) {
  return row.state.progress == Progress::kFinished && fs::exists(row.volume) &&
         fs::exists(paths_of(row).json);
}

std::vector<std::string> full_command(const fs::path& program, const Row& row,
                                      const fs::path& volume) {
  std::vector<std::string> command{program.string()};
  command.insert(command.end(), row.run.command.begin(), row.run.command.end());
  command.insert(command.end(),
                 {"-o", volume.string(), can_resume(row) ? "--resume" : "--overwrite"});
  return command;
}

std::vector<fs::path> files_of(const Row& row) {
  const output::OutputPaths paths = paths_of(row);
  std::vector<fs::path> files{
      state_of(row),        log_of(row),  paths.volume,       paths.model,
      paths.json,           paths.trials, paths.tree_picture, paths.held_out_picture,
      paths.choice_picture, paths.report};
  for (const fs::path& picture : paths.pictures()) files.push_back(picture);
  return files;
}

bool run_rows(const fs::path& program, const RunHooks& hooks, std::vector<Row>& rows) {
  for (Row& row : rows) {
    const bool is_there = is_done(row);
    if (!is_there && hooks.must_stop()) return false;
    if (hooks.run_starts) hooks.run_starts(row.run, is_there);
    if (!is_there && !run(program, hooks, row)) return false;
    row.summary = summary_of(row);
    require_one_grid({rows.front().run.name, read_grid(rows.front().volume)},
                     {row.run.name, read_grid(row.volume)});
  }
  return true;
}

}  // namespace tomofield::compare
