#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "batch/job.h"
#include "batch/series_list.h"
#include "option_table/setting.h"

namespace tomofield::batch {

/// The options by which series become jobs.
struct PlanOptions {
  std::filesystem::path program;  ///< tomofield itself
  std::filesystem::path list;     ///< what names the series: a table, a STAR file or a pattern
  std::filesystem::path folder;   ///< of the batch; it exists
  /// Options of all series, which an option of a series replaces.
  std::vector<option_table::GivenOption> common;
  int threads = 1;              ///< that a job may get at most
  bool skips_existing = false;  ///< leave finished series as they are, and continue others
  bool overwrites = false;
  std::function<bool()> stop_requested;
};

// The values of options and outputs have placeholders (placeholders.h). All functions throw Error
// for one that stands for nothing.

/// Returns where the tomogram of a series goes.
std::filesystem::path output_of(const Series& series, const std::filesystem::path& folder);

/// Returns the words after `tomofield` that reconstruct a series.
std::vector<std::string> command_of(const Series& series,
                                    const std::vector<option_table::GivenOption>& common);

/// Adds every placeholder that stands for nothing in the options of all series and of each.
void check_placeholders(const std::vector<Series>& all,
                        const std::vector<option_table::GivenOption>& common, base::Faults& faults);

/// Adds a mistake if an option names one series of a table of RELION, which are all reconstructed.
void check_tomograms(const std::vector<Series>& all,
                     const std::vector<option_table::GivenOption>& common, base::Faults& faults);

/// Makes a job of every series, and runs each with --plan to check it and to find what it needs.
/// Series that are skipped must have readable results, and are not checked otherwise. The outputs
/// of the series are there. Throws Error with the mistakes of all series, also if a file would be
/// written twice or is an input (file_conflicts.h). Returns fewer jobs if it was asked to stop.
JobList plan_jobs(const std::vector<Series>& all, const PlanOptions& options);

}  // namespace tomofield::batch
