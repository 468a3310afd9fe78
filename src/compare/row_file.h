#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tomofield::compare {

/// The costs of a run, in all of its sessions.
struct Costs {
  double core_seconds = 0, wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< peak of the largest session
};
Costs operator+(const Costs& one, const Costs& other);

/// The progress of a run. A run that is marked as running when nobody runs it was killed; its costs
/// since its last start are not known.
enum class Progress { kNone, kRunning, kStopped, kFinished };
NLOHMANN_JSON_SERIALIZE_ENUM(Progress, {{Progress::kNone, nullptr},
                                        {Progress::kRunning, "running"},
                                        {Progress::kStopped, "stopped"},
                                        {Progress::kFinished, "finished"}})

struct RowState {
  Progress progress = Progress::kNone;
  Costs costs;
};

/// Returns what decides a run's results: the version of tomofield, the command, and the path, size
/// and time of the files that it reads. Size and time tell whether a file has changed without
/// reading it.
nlohmann::json origin_of(const std::vector<std::string>& command,
                         const std::vector<std::filesystem::path>& inputs);

/// Reads the state of a run from `file` (NAME.row.json); returns kNone if there is no such file.
/// Throws Error, with every difference, if the run has another origin, and for a file that
/// write_row() did not write.
RowState read_row(const std::filesystem::path& file, const nlohmann::json& origin);
void write_row(const std::filesystem::path& file, const nlohmann::json& origin,
               const RowState& state);

/// Returns the metrics in the JSON file of a method. Throws Error if there are none.
nlohmann::json read_figures(const std::filesystem::path& file);

}  // namespace tomofield::compare
