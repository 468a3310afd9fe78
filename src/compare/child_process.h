#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace tomofield::compare {

/// The exit status of a program and its costs.
struct ChildResult {
  int exit_status = 0;  ///< 128 + the signal if a signal ended it
  double core_seconds = 0;
  double wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< largest resident size
};

/// Runs `command` (the program's path first) to its end and writes all its output to the file
/// `log`. It runs as its own process, so that its time and memory are its own. Asks
/// `stop_requested` often; once it returns true, asks the child to stop (SIGTERM) and waits for it.
/// If this process is killed, the system asks the child to stop; then a reconstruct saves a
/// checkpoint first. The child is in the same process group, so that the terminal stops both.
/// Throws Error if the log cannot be written or the program cannot be started.
ChildResult run_child(const std::vector<std::string>& command, const std::filesystem::path& log,
                      const std::function<bool()>& stop_requested);

/// Returns the reason why tomofield failed, from the file `log` of its output: its error message
/// without the program's name, or the last line if there is none.
std::string reason_of_failure(const std::filesystem::path& log);

}  // namespace tomofield::compare
