#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace tomofield::compare {

/// How a program ended, and what it took.
struct ChildResult {
  int exit_status = 0;  ///< 128 + the signal, if one ended it
  double core_seconds = 0;
  double wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< largest resident size
};

/// Runs `command` (the program's path first) to its end, with all that it says in the file
/// `log`: a process of its own, so that its time and memory are its own; its threads sleep while
/// they wait (OMP_WAIT_POLICY, unless it is set), so that core-seconds are of work.
/// `stop_requested` is asked often; when it says so, the child is asked to stop (SIGTERM) and
/// waited for. Throws Error if the log cannot be written or the program not be started.
ChildResult run_child(const std::vector<std::string>& command, const std::filesystem::path& log,
                      const std::function<bool()>& stop_requested);

/// Why tomofield failed, by the file `log` of all that it said: its own sentence, without its name
/// in front, or else the last line.
std::string reason_of_failure(const std::filesystem::path& log);

}  // namespace tomofield::compare
