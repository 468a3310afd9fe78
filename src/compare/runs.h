#pragma once

#include <vector>

#include "compare/comparison.h"
#include "tilt_series/tilt_series.h"

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
PlannedRuns plan_runs(const CompareOptions& options, const tilt_series::TiltSeries& series);

}  // namespace tomofield::compare
