#pragma once

#include <concepts>
#include <vector>

#include "base/progress.h"
#include "baseline/method.h"
#include "measurement/prepare.h"
#include "projection/sample_grid.h"
#include "tune/trials.h"

namespace tomofield::baseline {

/// The methods of which tune() can choose something.
template <typename Options>
concept HasWeight = requires(Options options) {
  options.weight;
};
template <typename Options>
concept StopsEarly = std::same_as<Options, SirtOptions> || std::same_as<Options, SartTvOptions>;
template <typename Options>
concept HasCutoff = std::same_as<Options, WbpOptions>;
template <typename Options>
concept Tunable = HasWeight<Options> || StopsEarly<Options> || HasCutoff<Options>;

/// Says whether tune() can choose something of a method.
bool is_tunable(const Method& method);

/// A method is the settings of its trials.
using Trial = tune::Trial<Method>;
using Tuned = tune::Tuned<Method>;

/// The data of the trials.
struct TrialData {
  const measurement::Measurement& measurement;
  projection::SampleGrid grid;
  std::vector<int> scored;  ///< views that score the result: no trial sees them; ascending
  bool fit_view_scale = false;
};

/// Chooses the settings that best predict views held out from the trials. Its rules, rows and views
/// are those of the main method's tuning (tune/trials.h, tune/trial_measurement.h).
///
/// It chooses the penalty if neither the penalty nor a weight is given: the views vote on both
/// penalties with their usual weights. It chooses the weight by search_weight(). For methods that
/// stop early it chooses the number of iterations: the candidates lie between a quarter and four
/// times that of `start`, in steps of √2, all of one run, and the smallest that cannot be told from
/// the best wins. For `wbp` it chooses the cutoff: the candidates lie between that of `start` and
/// an eighth of it, and the smallest that cannot be told from the best wins. Methods that are not
/// Tunable stay as they are.
///
/// For `tv` it repeats all trials with more iterations until the chosen trial has converged. The
/// result has the iterations of `start` all the same.
Tuned tune(const Method& start, const TrialData& data, const base::ProgressSink& progress);

}  // namespace tomofield::baseline
