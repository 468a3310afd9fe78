#pragma once

#include <functional>
#include <string>
#include <vector>

#include "fit/options.h"
#include "selection/weight_search.h"

namespace tomofield::selection {

/// What a trial fit of --tune is made with, in place of the options of the run.
struct TrialSettings {
  Penalty penalty = Penalty::kConcave;  ///< FitOptions::penalty
  double variation = 0;                 ///< FitOptions::density_variation
  int rank = 0;                         ///< FieldOptions::rank
  int epochs = 0;  ///< the learning rate falls over these, so each number is a schedule
  bool operator==(const TrialSettings&) const = default;
};

/// A trial fit and how well it predicts the views held out.
struct Trial {
  TrialSettings settings = {};
  HeldOutScore score = {};
  double seconds = 0;
};

/// Fits with these settings; the same settings always give the same error.
using RunTrial = std::function<Trial(const TrialSettings&)>;

/// What a search may change beside the weight and the epochs.
struct SearchSpace {
  bool penalty = true;  ///< concave or smooth, each first with its usual weight
  bool rank = true;     ///< of fields that have one
};

/// The penalty of total variation, with its usual weight, that predicts most of the
/// held-out views better (of equally many the concave one): edges as sharp as a concave one makes
/// them are right for some specimens only.
TrialSettings choose_penalty(const TrialSettings& start, const RunTrial& run);

/// The settings that predict held-out views best, one at a time: the penalty; the weight
/// of total variation by search_weight(); the rank among a third, two thirds and all of that of
/// `start`; and the epochs among half, once and twice those of `start`. What is better by no more
/// than the standard error of the difference over the views counts as equal, and then the largest
/// weight (the smoothest), the smallest rank and the fewest epochs win. No settings are
/// tried twice; `trials` receives every trial in order.
TrialSettings search_settings(const TrialSettings& start, const SearchSpace& space,
                              const RunTrial& run, std::vector<Trial>& trials);

/// Trials that a search makes, if its best weight is near the first.
int expected_trials(const SearchSpace& space);

}  // namespace tomofield::selection
