#pragma once

#include <vector>

#include "compare/comparison.h"

namespace tomofield::compare {

/// Why a run is made.
enum class Purpose { kVolume, kOddViews, kEvenViews, kHeldOutViews };

/// Every run of a comparison, purpose by purpose and in each in the order of the methods: what
/// runs for another purpose than the volume itself has its files named METHOD.odd, .even and
/// .held_out. Odd and even are counted in the stack's order among the sections that are not
/// excluded.
struct PlannedRuns {
  std::vector<Purpose> purposes;
  std::vector<Run> runs;  ///< [purpose][method]
};
PlannedRuns plan_runs(const CompareOptions& options, const tilt_series::TiltSeries& series);

}  // namespace tomofield::compare
