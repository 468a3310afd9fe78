#include "compare/rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>

#include "base/log.h"
#include "base/plausible.h"
#include "base/utf8.h"
#include "compare/grid.h"
#include "io/json.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kAdvice =
    "give another folder with -o, or --overwrite to make everything in this one again";

std::string not_of_this_comparison(const fs::path& file, const std::string& why) {
  return fmt::format("'{}' is not what this comparison wrote ({}): {}", file.string(), why,
                     kAdvice);
}

std::string command_text(const json& command) {
  return fmt::format("`tomofield {}`", fmt::join(command.get<std::vector<std::string>>(), " "));
}

std::vector<std::string> changed_files(const json& before, const json& now) {
  std::vector<std::string> changes;
  for (const auto& [path, state] : now.items()) {
    if (!before.contains(path))
      changes.push_back(fmt::format("it did not read '{}'", path));
    else if (before.at(path) != state)
      changes.push_back(fmt::format("'{}' has changed since", path));
  }
  for (const auto& [path, state] : before.items()) {
    if (!now.contains(path)) changes.push_back(fmt::format("it read '{}'", path));
  }
  return changes;
}

// Returns the differences of two origins, a clause each.
std::vector<std::string> changes(const json& before, const json& now) {
  std::vector<std::string> all = changed_files(before.at("files"), now.at("files"));
  if (before.at("command") != now.at("command")) {
    all.push_back(fmt::format("its command was {} and now is {}", command_text(before["command"]),
                              command_text(now.at("command"))));
  }
  if (before.at("tomofield") != now.at("tomofield")) {
    all.push_back(fmt::format("it is of tomofield {}, and this is {}",
                              before.at("tomofield").get<std::string>(),
                              now.at("tomofield").get<std::string>()));
  }
  return all;
}

// Returns the files of the run, and those in which the comparison keeps its state and all that it
// said.
output::OutputPaths paths_of(const Row& row) { return output::output_paths(row.volume); }
fs::path state_of(const Row& row) { return fs::path(row.volume).replace_extension(".row.json"); }
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
                          row.run.name, result.exit_status, base::reason_of_failure(log),
                          log.string()));
}

}  // namespace

std::vector<std::string> utf8_texts(const std::vector<std::string>& words) {
  std::vector<std::string> texts;
  for (const std::string& word : words) texts.push_back(base::utf8_text(word));
  return texts;
}

json origin_of(const std::vector<std::string>& command, const std::vector<fs::path>& inputs) {
  json files = json::object();
  for (const fs::path& path : inputs) {
    files[base::utf8_text(fs::absolute(path).string())] = {
        {"bytes", fs::file_size(path)},
        {"written", fs::last_write_time(path).time_since_epoch().count()}};
  }
  return {{"tomofield", TOMOFIELD_VERSION}, {"command", utf8_texts(command)}, {"files", files}};
}

RowState read_row(const fs::path& file, const json& origin) {
  if (!fs::exists(file)) return {};
  std::vector<std::string> differences;
  const auto read = [&](const json& row) {
    differences = changes(row.at("origin"), origin);
    return RowState{row.at("progress"),
                    {io::number_at(row, "core_seconds", 0, base::kLargestNumber),
                     io::number_at(row, "wall_seconds", 0, base::kLargestNumber),
                     io::integer_at(row, "peak_bytes", 0, INT64_MAX)}};
  };
  const RowState state = io::read_record(
      file, read, [&](const std::string& why) { return not_of_this_comparison(file, why); });
  if (differences.empty()) return state;
  throw Error(fmt::format("what '{}' tells of cannot be kept: {}: {}", file.string(),
                          fmt::join(differences, "; "), kAdvice));
}

void write_row(const fs::path& file, const json& origin, const RowState& state) {
  io::write_json(file, {{"origin", origin},
                        {"progress", state.progress},
                        {"core_seconds", state.costs.core_seconds},
                        {"wall_seconds", state.costs.wall_seconds},
                        {"peak_bytes", state.costs.peak_bytes}});
}

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
