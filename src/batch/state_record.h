#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "base/enum_names.h"
#include "base/system/child_process.h"
#include "batch/job.h"

namespace tomofield::batch {

/// The progress of a job.
enum class Progress { kWaiting, kRunning, kDone, kFailed, kStopped, kSkipped };

/// The progress of a job, with its costs in all sessions.
struct State {
  Progress progress = Progress::kWaiting;
  std::string reason;  ///< why it failed or was stopped
  base::Costs costs;
  /// When the last checkpoint of earlier runs was written that the first session of this batch
  /// found, in nanoseconds of the clock of files.
  std::optional<std::int64_t> old_checkpoint_ns = {};
};

/// Tells whether a session of the batch has begun a job that is not at its end.
inline bool has_begun(const State& state) {
  return state.progress == Progress::kStopped || state.progress == Progress::kRunning;
}

/// Returns when a checkpoint of a job was last written, as State has it; nothing without one.
std::optional<std::int64_t> checkpoint_time_ns(const Job& job);
/// Returns whether the next session of a job with this state continues what is there. If the job
/// replaces results, a checkpoint counts only if a session of this batch has left it.
bool continues(const State& before, const Job& job);

/// Returns the folder of logs and states, FOLDER/logs.
std::filesystem::path log_folder(const std::filesystem::path& folder);
/// Returns the file of all that a job says, and the file of its state.
std::filesystem::path log_of(const std::filesystem::path& folder, const Job& job);
std::filesystem::path state_file_of(const std::filesystem::path& folder, const Job& job);

/// Tells whether there is a state of a job that can be read.
bool has_state(const std::filesystem::path& folder, const Job& job);
/// Reads the state of a job. Returns one that waits if there is none, or none that can be read:
/// it only informs.
State read_state(const std::filesystem::path& folder, const Job& job);
/// Writes the state of a job. Each job has a file of its own, so that tasks on several machines do
/// not wait for each other.
void write_state(const std::filesystem::path& folder, const Job& job, const State& state);

}  // namespace tomofield::batch

template <>
struct tomofield::base::EnumNames<tomofield::batch::Progress> {
  using Progress = tomofield::batch::Progress;
  static constexpr std::array kNames{
      std::pair{Progress::kWaiting, "waiting"}, std::pair{Progress::kRunning, "running"},
      std::pair{Progress::kDone, "done"},       std::pair{Progress::kFailed, "failed"},
      std::pair{Progress::kStopped, "stopped"}, std::pair{Progress::kSkipped, "skipped"}};
};
