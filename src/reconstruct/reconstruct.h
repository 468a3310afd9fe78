#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "distributed/communicator.h"
#include "fit/stages.h"
#include "reconstruct/options.h"
#include "reconstruct/results.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// What the caller sees while it runs.
struct ReconstructHooks {
  base::ProgressSink progress;
  base::ProgressSink tune_progress;  ///< of the trials before the fit
  std::function<bool()>
      stop_requested;  ///< asked after every step; true saves a checkpoint and stops
};

enum class Outcome { kFinished, kStopped, kStoppedTuning };

/// What a run made.
struct RunResult {
  Outcome outcome = Outcome::kFinished;
  std::optional<Results> results;  ///< of a finished run
};

/// Does the main job: fits a field to the series and writes the volume (MRC), the
/// model (HDF5, also the checkpoint while it runs), and the metrics and resolved
/// options (JSON). Without ReconstructOptions::output, writes none of them and saves no checkpoint.
/// Call check_options() and plan_run() first: this starts at once.
///
/// Processes share the work if all of them call it: the results have the same bits as those of
/// one, which the first puts in place.
RunResult reconstruct(
    const tilt_series::TiltSeries& tilt_series, const ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// What a run will do; nothing is allocated or written for it.
struct RunPlan {
  int num_views = 0;
  std::int64_t view_width = 0, view_height = 0;
  double pixel_size_A = 0;
  Rectangle roi;
  double thickness = 0;
  int num_leaves = 0;
  std::size_t num_parameters = 0;
  int num_trials = 0;  ///< short fits before it, about, that choose settings
  std::vector<fit::Stage> stages;
  std::int64_t num_steps = 0;    ///< of all of them
  std::size_t memory_bytes = 0;  ///< estimated peak, of each process
};

/// Throws Error for options that do not fit the series or the number of processes, and when the
/// memory needed is beyond what the machine has.
RunPlan plan_run(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                 const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::reconstruction
