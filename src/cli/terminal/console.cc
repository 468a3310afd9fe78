#include "cli/terminal/console.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "base/progress.h"
#include "io/saving/scratch_memory.h"

namespace tomofield::cli {
namespace {

int g_output_error = 0;  // errno of the first failure

void remember_failure(bool has_failed) {
  if (has_failed && g_output_error == 0) g_output_error = errno;
}

volatile std::sig_atomic_t g_signal = 0;
void remember_signal(int signal) { g_signal = signal; }

void end_program(int signal) {
  const std::string_view line = io::scratch_fault();
  if (line.empty()) {  // another cause: the access is tried again, and ends the program
    std::signal(signal, SIG_DFL);
    return;
  }
  (void)!::write(STDERR_FILENO, line.data(), line.size());
  ::_exit(2);
}

}  // namespace

void tell_scratch_faults() { std::signal(SIGBUS, end_program); }

void open_console() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  // A stream that was closed cannot be written to: output_fault() says so.
  int descriptor = ::open("/dev/null", O_RDONLY);
  while (descriptor >= 0 && descriptor <= STDERR_FILENO) descriptor = ::open("/dev/null", O_RDONLY);
  if (descriptor >= 0) ::close(descriptor);
}

void print_text(std::string_view text) {
  remember_failure(std::fwrite(text.data(), 1, text.size(), stdout) != text.size());
}

std::string count_of(int number, std::string_view what) {
  return fmt::format("{} {}{}", number, what, number == 1 ? "" : "s");
}

void flush_output() { remember_failure(std::fflush(stdout) != 0); }

std::string output_fault() {
  flush_output();
  return g_output_error == 0 ? "" : std::strerror(g_output_error);
}

void say_text(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
  std::clearerr(stderr);
}

void stop_on_signals(bool is_job) {
  std::signal(SIGINT, remember_signal);
  std::signal(SIGTERM, remember_signal);
  if (std::signal(SIGHUP, remember_signal) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);  // by nohup
  if (is_job) std::signal(SIGUSR1, remember_signal);
}

void run_stoppable(const std::function<void()>& run) {
  stop_on_signals();
  const auto stop = [] {
    if (stop_was_requested()) throw base::StopRequested{};
  };
  base::set_interruption(stop);
  base::set_loop_interruption(stop);
  try {
    run();
  } catch (const base::StopRequested&) {
    throw ExitStatus{stop_status(),
                     "stopped; nothing was written, and old results are as they were"};
  }
}

bool stop_was_requested() { return g_signal != 0; }

int stop_status() { return 128 + (g_signal != 0 ? g_signal : SIGTERM); }

}  // namespace tomofield::cli
