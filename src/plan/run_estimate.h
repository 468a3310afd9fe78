#pragma once

#include <cstddef>
#include <optional>

#include "options/run_options.h"
#include "plan/plan.h"
#include "tilt_series/planned_series.h"

namespace tomofield::plan {

/// The cost of a run, beside its memory (RunPlan::memory_bytes).
struct RunEstimate {
  /// Processor time of all threads and processes. Nothing for the ray engine and for leaves above
  /// 256 pixels, whose steps cannot be measured in a small volume.
  std::optional<double> core_seconds;
  /// Samples of the field in all steps: how large the run is, the same on every machine. 0 for the
  /// ray engine.
  double sample_steps = 0;
  std::size_t result_bytes = 0;  ///< of the files that stay
  std::size_t disk_bytes = 0;    ///< at most, while it runs: with checkpoints and scratch files
};

/// Estimates what a run will take. It measures this machine for a fraction of a second: it decodes
/// one view of the series, and fits noise in a small volume with the views, the field and the
/// stages of the run. A step costs a fixed time and a time a sample, and the plan says how many
/// samples and steps there are. What a run decides on the way is not known: how many trials it
/// makes, how an adaptive tree grows, when --early-stop ends it.
RunEstimate estimate_run(const tilt_series::PlannedSeries& series,
                         const options::ReconstructOptions& options, const RunPlan& plan);

/// Throws Error if the disk has less room than the volumes and models of a run take.
void require_disk(const RunPlan& plan, const options::ReconstructOptions& options);

}  // namespace tomofield::plan
