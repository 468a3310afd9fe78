#pragma once

#include <optional>

#include "distributed/communicator.h"
#include "options/run_options.h"
#include "plan/plan.h"
#include "plan/run_estimate.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

/// Makes a reconstruction, from the files to the report: checks and locks its results, aligns the
/// views if the options ask for it, plans, chooses settings by trials, fits a field and samples it.
/// Writes the volume (MRC), the model (HDF5, which is also the checkpoint during the run), the
/// metrics with the options (JSON), pictures, files for other programs and the report (HTML). If
/// RunOptions::output is empty, it writes no file. With halves it makes three fits (halves.h).
/// Throws Error for bad input, and where the machine has too little memory.
///
/// If several processes call it, they share the work. The results have the same bits as those of
/// one process. The root writes the files.
RunResult run(options::ReconstructOptions options, const Observer& observer,
              const distributed::Communicator& processes = distributed::Communicator::alone());

/// The plan of a run, and the time and the disk that it needs.
struct Preview {
  plan::RunPlan plan;
  plan::RunEstimate estimate;
};

/// Checks a run and plans it, without a lock and without any result. Reads the views. Throws Error
/// as run() does.
Preview preview(const options::ReconstructOptions& options,
                const distributed::Communicator& processes = distributed::Communicator::alone());

/// Goes on as run() does up to the trials and ends there. Writes the choice and the trials as JSON
/// (tune/trial_record.h), or null if the options leave nothing to trials. Returns false if a stop
/// was requested.
bool choose(const std::filesystem::path& file, options::ReconstructOptions options,
            const Observer& observer,
            const distributed::Communicator& processes = distributed::Communicator::alone());

/// Aligns the views of a series, writes the alignment for other programs, and ends there. Returns
/// false if a stop was requested. Throws Error for bad input.
bool align(options::ReconstructOptions& options, const Observer& observer);

}  // namespace tomofield::reconstruction
