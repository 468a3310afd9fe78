#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <vector>

#include "distributed/communicator.h"
#include "option_table/values.h"
#include "options/run_options.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::cli {

/// What --dry-run asks for: the plan on the screen, and in a file for programs (write_grid()).
struct DryRun {
  bool is_wanted = false;
  std::optional<std::filesystem::path> grid = {};
};

/// Registers -o, --overwrite, --resume, --checkpoint-minutes and --dry-run.
void add_run_options(CLI::App& command, option_table::Choices& choices, DryRun& dry_run);

/// Returns an observer that draws progress bars and stops at a signal.
reconstruction::Observer terminal_observer(const distributed::Communicator& processes);

/// Prints the files of an alignment that a run has written. Prints nothing without --align.
void print_alignment(const options::ReconstructOptions& options);

/// Prints the paths of pictures.
void print_pictures(const std::vector<std::filesystem::path>& pictures);

/// Throws the ExitStatus of an alignment that a signal has stopped.
[[noreturn]] void throw_stopped_alignment();

/// Makes a reconstruction (reconstruction::run()): prints its plan, its progress and its files. A
/// dry run prints the plan alone. If a signal stops it, it throws an ExitStatus that says how to
/// continue: under another name for the trace if it leaves one (trace_option.h). Every process that
/// shares the run calls it; the root prints.
void run_reconstruction(
    const options::ReconstructOptions& options, const DryRun& dry_run, bool leaves_trace,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::cli
