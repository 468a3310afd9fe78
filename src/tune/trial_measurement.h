#pragma once

#include <cstdint>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/measurement.h"

namespace tomofield::tune {

/// Number of rows of a trial: enough for edges in every direction, few enough for a dozen fits.
constexpr std::int64_t kTrialRows = 64;

/// Lists the views that trials use, and which of them they predict. Numbers are those of the
/// series, ascending.
struct TrialViews {
  std::vector<int> fitted_or_predicted;
  std::vector<int> predicted;
};

/// Chooses the views of trials. `scored` lists the views that score the result, ascending. Trials
/// do not use these, so that no setting is chosen by the views that score it. Of the others, trials
/// predict every eighth (held_out_views()), or about five if there are fewer than forty. Throws
/// Error if fewer than six views are left.
TrialViews trial_views(const std::vector<double>& tilt_deg, const std::vector<int>& scored);

/// Returns the measurement of a trial: at most `max_rows` rows in the middle of `views`, with the
/// predicted views held out. Rays of a tilt about Y stay in their row, so a few rows are enough.
measurement::Measurement trial_measurement(
    const measurement::Measurement& whole, const TrialViews& views, std::int64_t max_rows,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::tune
