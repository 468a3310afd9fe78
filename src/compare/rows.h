#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "compare/methods.h"

namespace tomofield::compare {

/// The series that all methods reconstruct.
struct Series {
  std::filesystem::path stack;
  std::vector<std::string> arguments;  ///< words that say what it is, the stack among them
};

/// One method, run: its files are FOLDER/NAME.mrc, .json and .log, and what it took is kept in
/// FOLDER/NAME.row.json, so that a comparison that was interrupted goes on with the method after.
struct Row {
  Method method;
  std::vector<std::string> command;  ///< without the program and the output's name
  std::filesystem::path volume;
  double core_seconds = 0, wall_seconds = 0;
  std::int64_t peak_bytes = 0;
  nlohmann::json figures;  ///< of the method's own JSON
};

struct RunHooks {
  std::function<void(const Method& method, bool is_there_already)> method_starts;
  std::function<bool()> stop_requested;
};

enum class RowsOutcome { kFinished, kStopped };

/// Runs every method that has no row yet with `program`, one after the other. A row of another
/// command or of a series that has changed since is an Error, unless `overwrite`; so is a
/// method that fails, with the last line that it said and where its log is.
RowsOutcome run_rows(const std::filesystem::path& program, const Series& series,
                     const std::vector<Method>& methods, const std::filesystem::path& folder,
                     bool tune, bool overwrite, const RunHooks& hooks, std::vector<Row>& rows);

}  // namespace tomofield::compare
