#include "cli/terminal/stop_signal.h"

#include <csignal>

namespace tomofield::cli {
namespace {

volatile std::sig_atomic_t g_signal = 0;
void remember_signal(int signal) { g_signal = signal; }

}  // namespace

void stop_on_signals(bool is_job) {
  std::signal(SIGINT, remember_signal);
  std::signal(SIGTERM, remember_signal);
  if (is_job) std::signal(SIGUSR1, remember_signal);
}

bool stop_was_requested() { return g_signal != 0; }

int stop_status() { return 128 + (g_signal != 0 ? g_signal : SIGTERM); }

}  // namespace tomofield::cli
