#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"

namespace tomofield::selection {

/// Rows of a trial, in the middle: enough for edges in every direction, few enough for a dozen
/// fits.
constexpr std::int64_t kTrialRows = 64;

/// Views that trials of settings are made on, and which of them the trials predict.
struct TrialViews {
  std::vector<int> fitted_or_predicted;  ///< of the series, ascending
  std::vector<int> predicted;            ///< of the series, ascending
};

/// Trials predict every eighth of the views that do not score the result (held_out_views()), or
/// about five of fewer than forty, and never see those that do: the settings are then not chosen by
/// what scores them. `scored` ascends. Throws Error if fewer than six views are left.
TrialViews trial_views(const std::vector<double>& tilt_deg, const std::vector<int>& scored);

/// A series of these views alone, on some rows in the middle: enough for a trial, since rays of
/// a tilt about Y stay in their row. Views are counted anew, from 0.
struct TrialSeries {
  TrialViews views;           ///< as the whole series counts them
  std::vector<int> held_out;  ///< those predicted, as this one counts them
  geometry::TiltGeometry geometry;
  std::vector<double> noise_sigma;
  std::unique_ptr<measurement::SlabViews> rays;
};
TrialSeries make_trial_series(
    const geometry::TiltGeometry& geometry, const std::vector<double>& noise_sigma,
    const measurement::SlabViews& rays, const std::vector<int>& scored, std::int64_t most_rows,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::selection
