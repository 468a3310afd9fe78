#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"

namespace tomofield::base {

/// Returns the word that names a file in a command of this program: a file called "-x.mrc" would be
/// an option.
inline std::string file_word(const std::string& file) {
  return file.starts_with('-') ? "./" + file : file;
}

/// The time and the memory that a program took.
struct Costs {
  double core_seconds = 0, wall_seconds = 0;
  std::int64_t peak_bytes = 0;  ///< largest resident size
};
/// Returns the costs of two sessions of a run. The peak is that of the larger one.
Costs operator+(const Costs& one, const Costs& other);

/// The exit status of a program and its costs.
struct ChildResult {
  int exit_status = 0;  ///< 128 + the signal if a signal ended it
  Costs costs;
};

/// A program that runs as its own process, so that its time and memory are its own. If this process
/// is killed, the system asks the child to stop (SIGTERM); then a reconstruct saves a checkpoint
/// first. The child is in the same process group, so that the terminal stops both.
class ChildProcess {
 public:
  /// Starts `command` (the program's path first), which writes all its output to the file `log`.
  /// Throws Error if the log cannot be written or the program cannot be started.
  ChildProcess(const std::vector<std::string>& command, const std::filesystem::path& log);
  /// Asks a child that still runs to stop, and waits for it.
  ~ChildProcess();
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&&) = delete;

  /// Returns the result if the child has ended, and does not wait. Must not be called again then.
  std::optional<ChildResult> poll();
  /// Asks the child to stop (SIGTERM). A second call does nothing.
  void ask_to_stop();
  double wall_seconds() const { return running_.seconds(); }

 private:
  std::string program_;
  pid_t child_ = -1;  // -1 once it has ended, or moved from
  bool is_told_ = false;
  Stopwatch running_;
};

/// Waits a moment between two looks at children.
void pause_between_polls();

/// Runs a child to its end. Asks `stop_requested` often; once it returns true, asks the child to
/// stop and waits for it.
ChildResult run_child(const std::vector<std::string>& command, const std::filesystem::path& log,
                      const std::function<bool()>& stop_requested);

/// Returns the reason why a child with an exit status other than 0 failed, from the file `log` of
/// its output: its error message, or what else is known if it has said none.
std::string reason_of_failure(int exit_status, const std::filesystem::path& log);

/// Returns the reason why tomofield failed, from the file `log` of its output: its error message
/// without the program's name, or the last line if there is none.
std::string reason_of_failure(const std::filesystem::path& log);

/// Returns the path by which this program can be started again. The portable archive starts it
/// through a script, which says its own path in the variable TOMOFIELD_LAUNCHER (tools/portable).
std::filesystem::path program_path();

}  // namespace tomofield::base
