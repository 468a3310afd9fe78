#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tomofield::compare {

/// What a run took, in all of its sessions.
struct Costs {
  double core_seconds = 0, wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< the largest of a session
};
Costs operator+(const Costs& one, const Costs& other);

/// How far a run is. One that is still running when nobody runs it was killed, and what it took
/// since it was started is not known.
enum class Progress { kNone, kRunning, kStopped, kFinished };
NLOHMANN_JSON_SERIALIZE_ENUM(Progress, {{Progress::kNone, nullptr},
                                        {Progress::kRunning, "running"},
                                        {Progress::kStopped, "stopped"},
                                        {Progress::kFinished, "finished"}})

struct RowState {
  Progress progress = Progress::kNone;
  Costs costs;
};

/// What decides a run's results: the version of tomofield, the command, and path, size and time of
/// the files that it reads, which tell without reading them whether they have changed.
nlohmann::json origin_of(const std::vector<std::string>& command,
                         const std::vector<std::filesystem::path>& inputs);

/// What is kept of a run in `file` (NAME.row.json); kNone if there is no such file. Throws Error if
/// it is of another origin, with everything that differs, or not what write_row() wrote.
RowState read_row(const std::filesystem::path& file, const nlohmann::json& origin);
void write_row(const std::filesystem::path& file, const nlohmann::json& origin,
               const RowState& state);

/// The figures in the JSON that a method wrote. Throws Error if there are none.
nlohmann::json read_figures(const std::filesystem::path& file);

}  // namespace tomofield::compare
