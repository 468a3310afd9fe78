#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "base/progress.h"
#include "checkpoint/checkpoint.h"
#include "fit/fit.h"
#include "measurement/measurement.h"
#include "measurement/view_residuals.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

/// A fit to be made, and the place of its checkpoint.
struct FitJob {
  const measurement::Measurement& measurement;  ///< must outlive the fit
  const std::filesystem::path& model;           ///< the checkpoint
  const checkpoint::FitOrigin& origin;
  bool resumes = false;  ///< from the checkpoint, if there is one
  const base::ProgressSink& progress;
  /// Models that the views keep (fit::Fit::keep_views()). Empty: the fit finds its own.
  std::vector<measurement::ViewModel> kept_views = {};
  fit::FitPart part = {};
  bool may_learn = true;  ///< with the prior that the options say; else with total variation alone
};

/// A fit after its steps.
struct FitRun {
  std::unique_ptr<fit::Fit> fit;
  double seconds = 0.0;      ///< of its steps in this run
  bool was_stopped = false;  ///< there is a checkpoint then, if the run writes files
  bool took_steps = false;
};

/// Makes a fit, continues it from its checkpoint, and takes its steps. Saves checkpoints when they
/// are due, if the run writes files. Every process calls it.
FitRun run_fit(const Run& run, const FitJob& job);

}  // namespace tomofield::reconstruction
