#include "cli/options/trace_option.h"

#include <fmt/format.h>

#include <cstdio>

#include "base/log.h"
#include "base/trace.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "io/saving/atomic_file.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

namespace fs = std::filesystem;

void write_trace(const fs::path& path) {
  io::AtomicFile file(path);
  base::trace::write(file.temporary_path());
  file.commit();
  print("trace     {}\n", path.string());
}

// Writes the record of a run that throws. Its own exception matters more than one of the trace.
void write_trace_of_failure(const fs::path& path) {
  try {
    write_trace(path);
  } catch (const Error& error) {
    base::log_warning(error.what());
  }
}

}  // namespace

void add_trace_option(CLI::App& command, std::optional<fs::path>& file) {
  command
      .add_option(
          "--trace", file,
          "Write what the run did and when, with its loops and the tasks of some steps, for "
          "chrome://tracing or ui.perfetto.dev")
      ->type_name("FILE.json")
      ->group(kHelpAllGroup);
}

void run_traced(const std::optional<fs::path>& file, const distributed::Communicator& processes,
                const std::function<void()>& run) {
  if (!file || !processes.is_root()) return run();
  base::trace::start();
  try {
    run();
  } catch (...) {
    write_trace_of_failure(*file);
    throw;
  }
  write_trace(*file);
}

}  // namespace tomofield::cli
