#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/progress.h"
#include "fit/fit.h"
#include "selection/trial_file.h"

namespace tomofield::reconstruction {

/// Holds the settings that trials choose. They replace options of the run.
struct TrialSettings {
  Penalty penalty = Penalty::kConcave;  ///< FitOptions::penalty
  double variation = 0;                 ///< FitOptions::density_variation
  int rank = 0;                         ///< FieldOptions::rank
  int epochs = 0;                       ///< FitOptions::epochs; the learning rate decays over these
  bool operator==(const TrialSettings&) const = default;
};
using FitTrial = selection::Trial<TrialSettings>;
using FitTrials = selection::Trials<TrialSettings>;
using TunedFit = selection::Tuned<TrialSettings>;

/// Says what a search may change in addition to the weight and the epochs.
struct SearchSpace {
  bool penalty = true;  ///< compare the concave and the smooth penalty
  bool rank = true;     ///< compare ranks; the field must have one
};

/// Prepares the trials of a search; `run` makes some trials. Settings whose weights differ by
/// rounding count as equal.
FitTrials make_trials(FitTrials::RunTrials run);

/// Chooses the penalty of total variation, each with its usual weight: the concave one if it
/// predicts the held-out views better by more than the standard error of the difference, else the
/// smooth one. A concave penalty makes sharp edges, which are right for some specimens only; where
/// held-out views cannot tell, it paints flat regions that are none.
TrialSettings choose_penalty(const TrialSettings& start, FitTrials& trials);

/// Chooses the penalty by choose_penalty(). If it is the smooth one, chooses its weight as well,
/// from 0.56 to 3.2 times the usual: the largest that is as good as the best.
TrialSettings choose_variation(const TrialSettings& start, FitTrials& trials);

/// Chooses the settings that predict held-out views best, one after another:
///
///   1. the penalty,
///   2. the weight of total variation (selection::search_weight),
///   3. the rank: a third, two thirds or all of that of `start`,
///   4. the epochs: half, once or twice those of `start`.
///
/// Settings count as equally good if their errors differ by no more than the standard error of the
/// difference over the views. Of equally good settings it takes the largest weight (the smoothest
/// tomogram), the smallest rank and the smallest number of epochs.
TrialSettings search_settings(const TrialSettings& start, const SearchSpace& space,
                              FitTrials& trials);

/// Returns the number of trials of a search whose best weight is near the first.
int expected_trials(const SearchSpace& space);

/// Holds the callbacks of a search. They are called in the thread that searches.
struct TuneHooks {
  base::ProgressSink progress;
  std::function<bool()> stop_requested;  ///< is asked after every step
};

/// Writes settings in the form that trial files and metrics have.
nlohmann::json settings_json(const TrialSettings& settings);
/// Reads a trial that selection::trial_json() has written with such settings.
FitTrial trial_from(const nlohmann::json& entry);
/// Writes the chosen settings and all trials.
nlohmann::json tuning_json(const TunedFit& tuned);
/// Reads what tuning_json() has written. Throws nlohmann::json::exception if it is damaged.
TunedFit tuned_from(const nlohmann::json& tuning);

/// Chooses settings by search_settings(); the penalty only if `tunes_penalty`. Trials use some rows
/// in the middle and none of the views that `measurement` holds out to score the result. `file`
/// stores finished trials, and trials that it has are not repeated. Returns nothing if a stop was
/// requested. Throws Error for too few views. Every process calls it.
std::optional<TunedFit> tune(
    const measurement::Measurement& measurement, const fit::FieldOptions& field,
    const fit::FitOptions& fit, bool tunes_penalty, selection::TrialFile& file,
    const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Chooses penalty and weight by choose_variation(), in two to five trials on half as many rows.
/// The trials use plain vertices, whatever the field of the run: the right penalty depends on the
/// specimen, and plain vertices converge in a fraction of the time. The trials take a few per cent
/// of a fit of 256 rows. Returns nothing if a stop was requested. Every process calls it.
std::optional<TunedFit> tune_penalty(
    const measurement::Measurement& measurement, const fit::FieldOptions& field,
    const fit::FitOptions& fit, const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::reconstruction
