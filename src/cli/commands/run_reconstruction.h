#pragma once

#include <CLI/CLI.hpp>

#include "distributed/communicator.h"
#include "option_table/values.h"
#include "options/run_options.h"
#include "reconstruct/reconstruct.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Registers -o, --overwrite, --resume, --checkpoint-minutes and --dry-run.
void add_run_options(CLI::App& command, option_table::Choices& choices, bool& dry_run);

/// Checks the options of a run, which needs an output, and returns the locks of its files
/// (reconstruction::claim_outputs()). With `check_alone` it locks nothing.
std::vector<io::OutputLock> claim_run(const options::ReconstructOptions& options, bool check_alone);

/// Opens the series of a run. If the options ask for it and the run is not dry, checks first
/// whether the whole run is possible, and aligns the series (align_and_open()).
tilt_series::TiltSeries open_series(options::ReconstructOptions& options, bool dry_run,
                                    const distributed::Communicator& processes);

/// Aligns a series with a progress bar, puts what it found into the options, and opens the series.
/// Throws an ExitStatus if a signal stops it.
tilt_series::TiltSeries align_and_open(options::ReconstructOptions& options,
                                       const distributed::Communicator& processes);

/// Prints the files of an alignment that a run has written. Prints nothing without --align.
void print_alignment(const options::ReconstructOptions& options);

/// Prints the plan of a reconstruction, runs it with a progress bar, and writes its pictures. With
/// `dry_run` it prints the plan alone. The caller has called claim_run() before. If a signal stops
/// it, it throws an ExitStatus that says how to continue. Every process that shares the run calls
/// it; the root prints and writes pictures.
void run_reconstruction(
    const tilt_series::TiltSeries& series, const options::ReconstructOptions& options, bool dry_run,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::cli
