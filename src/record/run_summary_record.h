#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tomofield::record {

/// Collects what tables say of a finished run or baseline.
struct RunSummary {
  std::optional<double> num_parameters;
  std::optional<double> held_out_error;  ///< none if no views were held out
  std::string verdict;                   ///< its line; empty for a baseline
  std::vector<std::string> warnings;
};

/// Reads the summary from the JSON file beside a volume. What a run of another version does not say
/// is left empty. Throws Error with what is wrong, but not where, if the file is no such record.
RunSummary read_summary(const std::filesystem::path& file);

}  // namespace tomofield::record
