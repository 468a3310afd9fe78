#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "checkpoint/checkpoint.h"
#include "distributed/communicator.h"
#include "geometry/raw_from_aligned.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "output/output_paths.h"

namespace tomofield::reconstruction {

struct Results;

/// Writes more results of a run, whose volume is in the file `volume`.
using WriteMore = std::function<void(const Results& results, const std::filesystem::path& volume)>;

/// The callbacks of a run.
struct ReconstructHooks {
  base::ProgressSink progress;       ///< receives the progress of the fit
  base::ProgressSink tune_progress;  ///< receives the progress of the trials before the fit
  /// Is asked after every step. If it returns true, the run saves a checkpoint and stops.
  std::function<bool()> stop_requested;
  /// Writes more results, which appear together with the others.
  WriteMore write_more = {};
};

/// What the steps of a run share.
struct Run {
  const ReconstructHooks& hooks;
  const distributed::Communicator& processes;
  options::ReconstructOptions options;
  output::OutputPaths paths;
  measurement::Measurement measurement;  ///< of all views

  bool writes_files() const { return !options.resolved.output.empty(); }
};

/// What a run knows beside its fit.
struct RunRecord {
  checkpoint::FitOrigin origin;
  /// Where the pixels of each aligned view come from in the stack.
  std::vector<geometry::RawFromAligned> alignment;
  double fit_seconds = 0.0;
};

}  // namespace tomofield::reconstruction
