#pragma once

#include <functional>
#include <vector>

#include "base/progress.h"
#include "checkpoint/checkpoint.h"
#include "distributed/communicator.h"
#include "geometry/raw_from_aligned.h"
#include "measurement/measurement.h"
#include "options/run_options.h"
#include "output/output_paths.h"
#include "plan/plan.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// Receives what a run tells while it goes on. Any of them may be empty.
struct Observer {
  /// Is called with the plan that the run follows, once the machine is known to have room for it.
  std::function<void(const plan::RunPlan& plan)> planned;
  base::ProgressSink alignment;  ///< receives the progress of the alignment before the fit
  base::ProgressSink trials;     ///< of the trials before the fit
  base::ProgressSink fit;        ///< of the fit
  /// Is asked after every step. If it returns true, the run saves a checkpoint and stops.
  std::function<bool()> stop_requested;
};

/// What the steps of a run share.
struct Run {
  const Observer& observer;
  const distributed::Communicator& processes;
  const tilt_series::TiltSeries& series;
  options::ReconstructOptions options;
  output::OutputPaths paths;
  /// Where the pixels of each aligned view come from in the stack.
  std::vector<geometry::RawFromAligned> alignment;
  measurement::Measurement measurement;  ///< of all views

  bool writes_files() const { return !options.run.output.empty(); }
};

/// What is kept of a fit beside its field.
struct FitOutcome {
  checkpoint::FitOrigin origin;
  double seconds = 0.0;  ///< of its steps
};

}  // namespace tomofield::reconstruction
