#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <vector>

#include "distributed/communicator.h"
#include "option_table/values.h"
#include "options/run_options.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::cli {

/// Registers -o, --overwrite, --resume, --checkpoint-minutes and --dry-run.
void add_run_options(CLI::App& command, option_table::Choices& choices, bool& dry_run);

/// Returns an observer that draws progress bars and stops at a signal.
reconstruction::Observer terminal_observer(const distributed::Communicator& processes);

/// Prints the files of an alignment that a run has written. Prints nothing without --align.
void print_alignment(const options::ReconstructOptions& options);

/// Prints the paths of pictures.
void print_pictures(const std::vector<std::filesystem::path>& pictures);

/// Throws the ExitStatus of an alignment that a signal has stopped.
[[noreturn]] void throw_stopped_alignment();

/// Makes a reconstruction (reconstruction::run()): prints its plan, its progress and its files.
/// With `dry_run` it prints the plan alone. If a signal stops it, it throws an ExitStatus that says
/// how to continue. Every process that shares the run calls it; the root prints.
void run_reconstruction(
    const options::ReconstructOptions& options, bool dry_run,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::cli
