#pragma once

#include <cstdint>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/measurement.h"

namespace tomofield::selection {

/// Rows of a trial, in the middle: enough for edges in every direction, few enough for a dozen
/// fits.
constexpr std::int64_t kTrialRows = 64;

/// Views that trials of settings are made on, and which of them the trials predict.
struct TrialViews {
  std::vector<int> fitted_or_predicted;  ///< of the series, ascending
  std::vector<int> predicted;            ///< of the series, ascending
};

/// Chooses views for trials. Trials predict every eighth of the views that do not score the result
/// (held_out_views()), or about five of fewer than forty, and never see those that do: the settings
/// are then not chosen by what scores them. `scored` ascends. Throws Error if fewer than six views
/// are left.
TrialViews trial_views(const std::vector<double>& tilt_deg, const std::vector<int>& scored);

/// Returns the measurement that trials are made on: `views` alone, on at most `max_rows` rows in
/// the middle, with the predicted views held out. These rows are enough for a trial, since rays of
/// a tilt about Y stay in their row.
measurement::Measurement trial_measurement(
    const measurement::Measurement& whole, const TrialViews& views, std::int64_t max_rows,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::selection
