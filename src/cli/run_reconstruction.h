#pragma once

#include <CLI/CLI.hpp>

#include "distributed/communicator.h"
#include "option_table/values.h"
#include "reconstruct/reconstruct.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Registers -o, --overwrite, --resume, --checkpoint-minutes and --dry-run.
void add_run_options(CLI::App& command, option_table::Choices& choices, bool& dry_run);

/// Prints the plan of a fit, runs it, with progress and until it is interrupted, and writes its
/// pictures. Only the plan if `dry_run`. Call reconstruct::check_options() first. Throws ExitStatus
/// when it was stopped by a signal, with what there is to go on from. Processes that share it all
/// call it; the first reports and writes pictures.
void run_reconstruction(
    const tilt_series::TiltSeries& series, const reconstruction::ReconstructOptions& options,
    bool dry_run, const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::cli
