#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compare/methods.h"
#include "compare/row_record.h"
#include "record/run_summary_record.h"

namespace tomofield::compare {

/// A run of a method.
struct Run {
  std::string name;  ///< the name of its files
  Method method;
  std::vector<std::string> command;           ///< without the program and the output's name
  std::vector<std::filesystem::path> inputs;  ///< every file that it reads
};

/// A run and its progress. Its files are FOLDER/NAME.mrc, .json and .log. Its costs are in
/// FOLDER/NAME.row.json, so that a comparison that was interrupted continues where it stopped.
struct Row {
  Run run;
  std::filesystem::path volume;
  RunOrigin origin;
  RowState state;
  record::RunSummary summary = {};  ///< once it is finished
};

struct RunHooks {
  std::function<void(const Run& run, bool is_there_already)> run_starts;
  std::function<bool()> stop_requested;
  bool must_stop() const { return stop_requested && stop_requested(); }
};

/// Returns a row a run, with the state stored in `folder`. Throws Error if a stored row has other
/// options, other files or another version (read_row).
std::vector<Row> stored_rows(const std::vector<Run>& runs, const std::filesystem::path& folder);
/// Returns a row a run, as if the folder were empty.
std::vector<Row> new_rows(const std::vector<Run>& runs, const std::filesystem::path& folder);

/// Notes that the files of all rows are those of this comparison from now on, as --overwrite says,
/// whichever of their runs begin before it is stopped.
void claim_rows(std::vector<Row>& rows);

/// Returns the name of the run whose state a file holds; empty for other files.
std::string run_of_state(const std::filesystem::path& file);

/// Returns true if the row is finished and its files exist.
bool is_done(const Row& row);

/// Returns the command of the row's run, made by `program` into `volume`. It has --resume if the
/// run continues from stored files.
std::vector<std::string> full_command(const std::filesystem::path& program, const Row& row,
                                      const std::filesystem::path& volume);

/// Returns the files that a run and its comparison write, whether they exist or not.
std::vector<std::filesystem::path> files_of(const Row& row);

/// Makes every run that is not done with `program`, one after the other. Returns false if it was
/// stopped. Throws Error if a run fails, with its message and the place of its log, and for a
/// volume of another size than the first. Finished runs stay.
bool run_rows(const std::filesystem::path& program, const RunHooks& hooks, std::vector<Row>& rows);

}  // namespace tomofield::compare
