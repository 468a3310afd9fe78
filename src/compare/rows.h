#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "compare/methods.h"
#include "compare/row_file.h"

namespace tomofield::compare {

/// A run of a method.
struct Run {
  std::string name;  ///< of its files
  Method method;
  std::vector<std::string> command;           ///< without the program and the output's name
  std::vector<std::filesystem::path> inputs;  ///< every file that it reads
};

/// A run and how far it is: its files are FOLDER/NAME.mrc, .json and .log, and what it took is kept
/// in FOLDER/NAME.row.json, so that a comparison that was interrupted goes on where it stopped.
struct Row {
  Run run;
  std::filesystem::path volume;
  nlohmann::json origin;  ///< origin_of() the run
  RowState state;
  nlohmann::json figures = nullptr;  ///< of the method's own JSON, once it is finished
};

struct RunHooks {
  std::function<void(const Run& run, bool is_there_already)> run_starts;
  std::function<bool()> stop_requested;
  bool must_stop() const { return stop_requested && stop_requested(); }
};

/// A row a run, as `folder` has it. Throws Error if a row there is of other options, files or
/// another version (read_row).
std::vector<Row> stored_rows(const std::vector<Run>& runs, const std::filesystem::path& folder);
/// The same, as if the folder were empty.
std::vector<Row> new_rows(const std::vector<Run>& runs, const std::filesystem::path& folder);

/// Whether the row is finished and its files are there.
bool is_done(const Row& row);

/// Of the row's run, by `program` into `volume`: --resume if it goes on from what is there.
std::vector<std::string> full_command(const std::filesystem::path& program, const Row& row,
                                      const std::filesystem::path& volume);

/// Removes whatever rows and their runs have left.
void remove_results(const std::vector<Row>& rows);

/// Makes every run that is not done with `program`, one after the other; false if it was stopped.
/// Throws Error if a run fails, with what it said and where its log is, and for a volume of other
/// sizes than the first; what is finished stays.
bool run_rows(const std::filesystem::path& program, const RunHooks& hooks, std::vector<Row>& rows);

}  // namespace tomofield::compare
