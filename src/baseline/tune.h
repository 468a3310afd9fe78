#pragma once

#include <concepts>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "baseline/method.h"
#include "measurement/prepare.h"
#include "projection/sample_grid.h"
#include "selection/weight_search.h"

namespace tomofield::baseline {

/// Methods that tune() can choose something of.
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

/// A method with its settings, and how well it predicts the views held out.
struct Trial {
  Method method;
  selection::HeldOutScore score = {};
  double seconds = 0;
  std::optional<double> last_decrease = {};  ///< of its own run: see last_decrease()
};

struct Tuned {
  Method method;
  std::vector<Trial> trials;         ///< in order
  std::vector<int> predicted_views;  ///< by which they were chosen
};

/// What trials are made on.
struct TrialData {
  const measurement::PreparedSeries& series;
  projection::SampleGrid grid;
  std::vector<int> scored;  ///< views that score the result: no trial sees them; ascending
  bool fit_view_scale = false;
};

/// Chooses the settings that predict views held out from the trials best, by the rules of the main
/// method's tuning (reconstruct/tune.h) and on the same rows and views
/// (reconstruct/trial_series.h): the penalty, if neither it nor a weight is given, by a vote of the
/// views on both with their usual weights; the weight by search_weight(); and of methods that stop
/// early the number of iterations, between a quarter and four times that of `start` in steps of √2,
/// all of one run, the fewest of those that cannot be told from the best; of `wbp` the cutoff, from
/// that of `start` down to an eighth of it, the smallest of those that cannot be told from the
/// best. Methods that are not Tunable stay as they are. Of `tv` everything is tried anew with more
/// iterations until the trial that is chosen has converged; what is chosen has the iterations of
/// `start`.
Tuned tune(const Method& start, const TrialData& data, const base::ProgressSink& progress);

/// What was chosen, and every trial.
nlohmann::json tuning_json(const Tuned& tuned);

}  // namespace tomofield::baseline
