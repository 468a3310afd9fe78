#pragma once

#include <fmt/format.h>

#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/utf8.h"

namespace tomofield::cli {

/// Makes the standard streams safe to write to. Opens those that are closed, so that no file of a
/// run gets their number. Lets a write to a pipe that nobody reads, or beyond the limit of a file's
/// size (ulimit -f), fail instead of ending the program.
void open_console();

/// Lets a disk that loses a scratch file while it is used (SIGBUS) end the program with a sentence
/// and status 2, as other faults of the disk do.
void tell_scratch_faults();

/// Returns an argument of a message as it is shown: a text, which may be the name or the content of
/// a file, does not control the terminal (base/utf8.h).
template <typename T>
auto shown(const T& value) {
  if constexpr (std::is_convertible_v<const T&, std::string_view>)
    return base::printable(value);
  else
    return value;
}

/// Writes text to standard output, and remembers whether that failed. Never throws: a run goes on
/// although nobody can read what it says.
void print_text(std::string_view text);
template <typename... Args>
void print(fmt::format_string<Args...> format, Args&&... args) {
  print_text(fmt::format(fmt::runtime(format), shown(args)...));
}
/// Returns a number with what it counts: "1 thread", "2 threads".
std::string count_of(int number, std::string_view what);
/// Hands to the system what has been printed, so that it comes before other output.
void flush_output();
/// Flushes standard output. Returns why something that was printed is lost, or an empty text.
std::string output_fault();

/// Writes text to standard error. Text that cannot be written is lost. Never throws.
void say_text(std::string_view text);
template <typename... Args>
void say(fmt::format_string<Args...> format, Args&&... args) {
  say_text(fmt::format(fmt::runtime(format), shown(args)...));
}

/// Ends the program with a message and a status of its own. A run that a signal stopped is neither
/// a success nor a fault.
class ExitStatus : public std::runtime_error {
 public:
  ExitStatus(int status, const std::string& message)
      : std::runtime_error(message), status_(status) {}
  int status() const { return status_; }

 private:
  int status_;
};

/// Lets Ctrl-C (SIGINT), SIGTERM and the end of the terminal (SIGHUP) ask the program to stop
/// instead of ending it. In a job of several processes SIGUSR1 asks for it too, because mpirun
/// passes it on without a time limit.
void stop_on_signals(bool is_job = false);

/// Does work that has no checkpoints. Ctrl-C and SIGTERM end it with an ExitStatus, and it leaves
/// no files of its own behind.
void run_stoppable(const std::function<void()>& run);

/// Returns true if one of these signals has come.
bool stop_was_requested();

/// Returns the exit status of a stopped run: 128 plus the signal. If this process got no signal,
/// another process of the job did, and SIGTERM's status is returned.
int stop_status();

}  // namespace tomofield::cli
