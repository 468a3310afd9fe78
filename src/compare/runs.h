#pragma once

#include <vector>

#include "compare/comparison.h"
#include "tilt_series/planned_series.h"

namespace tomofield::compare {

/// The purpose of a run.
enum class Purpose { kVolume, kOddViews, kEvenViews, kHeldOutViews };

/// Every run of a comparison, purpose by purpose, and for each purpose in the order of the methods.
/// The files of a run whose purpose is not the volume itself are named METHOD.odd, METHOD.even and
/// METHOD.held_out. Odd and even are counted in the stack's order among the sections that are not
/// excluded.
struct PlannedRuns {
  std::vector<Purpose> purposes;
  std::vector<Run> runs;  ///< [purpose][method]
};
PlannedRuns plan_runs(const CompareOptions& options, const tilt_series::PlannedSeries& series);

/// Finds out before the first run what would stop a comparison later. Runs the commands of all
/// unfinished rows with --dry-run, and compares the grids of the volumes with the first one's and
/// with the truth's. Returns false if it was asked to stop. Throws Error with the name of the
/// method and the message of its command, for volumes that cannot be compared, and for a folder
/// that cannot be written. The folder exists and is locked.
bool rehearse(const CompareOptions& options, const RunHooks& hooks, const std::vector<Row>& rows);

}  // namespace tomofield::compare
