#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "compare/methods.h"

namespace tomofield::compare {

/// A run of a method.
struct Run {
  std::string name;  ///< of its files
  Method method;
  std::vector<std::string> command;  ///< without the program and the output's name
};

/// A run that is done: its files are FOLDER/NAME.mrc, .json and .log, and what it took is kept in
/// FOLDER/NAME.row.json, so that a comparison that was interrupted goes on with the run after.
struct Row {
  Run run;
  std::filesystem::path volume;
  double core_seconds = 0, wall_seconds = 0;
  std::int64_t peak_bytes = 0;
  nlohmann::json figures;  ///< of the method's own JSON
};

struct RunHooks {
  std::function<void(const Run& run, bool is_there_already)> run_starts;
  std::function<bool()> stop_requested;
};

enum class RowsOutcome { kFinished, kStopped };

/// Makes every run of the series `stack` that has no row yet with `program`, one after the
/// other. A row of another command or of a series that has changed since is an Error, unless
/// `overwrite`; so is a run that fails, with the last line that it said and where its log is.
RowsOutcome run_rows(const std::filesystem::path& program, const std::filesystem::path& stack,
                     const std::vector<Run>& runs, const std::filesystem::path& folder,
                     bool overwrite, const RunHooks& hooks, std::vector<Row>& rows);

}  // namespace tomofield::compare
