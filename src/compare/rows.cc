#include "compare/rows.h"

#include <fmt/format.h>

#include <fstream>

#include "compare/child_process.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// Tells a series from what it was before, without reading it.
json state_of(const fs::path& stack) {
  return {{"path", fs::absolute(stack).string()},
          {"bytes", fs::file_size(stack)},
          {"written", fs::last_write_time(stack).time_since_epoch().count()}};
}

json read_json(const fs::path& path) {
  std::ifstream file(path);
  const json document = json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) {
    throw Error(fmt::format("'{}' is not what a comparison wrote: remove it, or give --overwrite",
                            path.string()));
  }
  return document;
}

std::string last_line(const fs::path& log) {
  std::ifstream file(log);
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

// Runs one method; false if it was stopped.
bool run(const fs::path& program, const fs::path& log, const RunHooks& hooks, Row& row) {
  std::vector<std::string> command{program.string()};
  command.insert(command.end(), row.run.command.begin(), row.run.command.end());
  command.insert(command.end(), {"-o", row.volume.string()});
  const bool has_checkpoint = fs::exists(fs::path(row.volume).replace_extension(".h5"));
  command.push_back(row.run.method.resumes && has_checkpoint ? "--resume" : "--overwrite");
  const ChildResult result = run_child(command, log, hooks.stop_requested);
  if (hooks.stop_requested && hooks.stop_requested()) return false;
  if (result.exit_status != 0) {
    throw Error(fmt::format("{} failed with status {}: {} (all that it said is in '{}')",
                            row.run.name, result.exit_status, last_line(log), log.string()));
  }
  row.core_seconds = result.core_seconds;
  row.wall_seconds = result.wall_seconds;
  row.peak_bytes = result.peak_bytes;
  return true;
}

json row_json(const Row& row, const json& state) {
  return {{"command", row.run.command},
          {"series", state},
          {"core_seconds", row.core_seconds},
          {"wall_seconds", row.wall_seconds},
          {"peak_bytes", row.peak_bytes}};
}

// Whether the row is in its file; what it took is then in `row`.
bool is_done(const fs::path& file, const json& state, Row& row) {
  if (!fs::exists(file) || !fs::exists(row.volume)) return false;
  const json stored = read_json(file);
  if (stored.value("command", json()) != row.run.command ||
      stored.value("series", json()) != state) {
    throw Error(fmt::format(
        "'{}' is of another series or of other options: give another folder with -o, or "
        "--overwrite to make everything in this one anew",
        file.string()));
  }
  row.core_seconds = stored.at("core_seconds");
  row.wall_seconds = stored.at("wall_seconds");
  row.peak_bytes = stored.at("peak_bytes");
  return true;
}

void remove_results(const fs::path& folder, const std::string& name) {
  for (const char* extension : {".mrc", ".h5", ".json", ".row.json", ".log"})
    fs::remove(folder / (name + extension));
}

}  // namespace

RowsOutcome run_rows(const fs::path& program, const fs::path& stack, const std::vector<Run>& runs,
                     const fs::path& folder, bool overwrite, const RunHooks& hooks,
                     std::vector<Row>& rows) {
  const json state = state_of(stack);
  for (const Run& wanted : runs) {
    if (overwrite) remove_results(folder, wanted.name);
    Row row{.run = wanted, .volume = folder / (wanted.name + ".mrc"), .figures = {}};
    const fs::path file = folder / (wanted.name + ".row.json");
    const bool is_there = is_done(file, state, row);
    if (hooks.run_starts) hooks.run_starts(wanted, is_there);
    if (!is_there) {
      if (!run(program, folder / (wanted.name + ".log"), hooks, row)) return RowsOutcome::kStopped;
      io::write_json(file, row_json(row, state));
    }
    row.figures = read_json(folder / (wanted.name + ".json")).at("figures");
    rows.push_back(std::move(row));
  }
  return RowsOutcome::kFinished;
}

}  // namespace tomofield::compare
