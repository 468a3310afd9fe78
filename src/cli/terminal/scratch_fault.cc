#include "cli/terminal/scratch_fault.h"

#include <unistd.h>

#include <csignal>

#include "io/saving/scratch_memory.h"

namespace tomofield::cli {
namespace {

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

}  // namespace tomofield::cli
