#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/progress.h"
#include "fit/fit.h"
#include "reconstruct/tuning.h"
#include "selection/trial_file.h"

namespace tomofield::reconstruction {

/// Settings that trials choose, in place of the options of the run.
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

/// What a search may change beside the weight and the epochs.
struct SearchSpace {
  bool penalty = true;  ///< concave or smooth, each first with its usual weight
  bool rank = true;     ///< of fields that have one
};

/// Makes the trials of a search with `run`; settings whose weights differ by rounding are equal.
FitTrials make_trials(FitTrials::RunTrial run);

/// Returns the penalty of total variation, with its usual weight, that most held-out views prefer;
/// the concave one, if as many prefer either. Edges as sharp as a concave penalty makes them are
/// right for some specimens only.
TrialSettings choose_penalty(const TrialSettings& start, FitTrials& trials);

/// Chooses the settings that predict held-out views best, one at a time: the penalty; the weight
/// of total variation (selection::search_weight); the rank among a third, two thirds and all of
/// that of `start`; and the epochs among half, once and twice those of `start`. Settings that are
/// better by no more than the standard error of the difference over the views count as equal; then
/// the largest weight (the smoothest tomogram), the smallest rank and the fewest epochs win.
TrialSettings search_settings(const TrialSettings& start, const SearchSpace& space,
                              FitTrials& trials);

/// Returns the number of trials of a search whose best weight is near the first.
int expected_trials(const SearchSpace& space);

/// What the caller sees of a search while it runs.
struct TuneHooks {
  base::ProgressSink progress;
  std::function<bool()> stop_requested;  ///< asked after every step
};

/// Writes settings as trial files and results have them.
nlohmann::json settings_json(const TrialSettings& settings);
/// Writes what a search chose and everything that it tried; tuned_from() reads it.
nlohmann::json tuning_json(const TunedFit& tuned);
TunedFit tuned_from(const nlohmann::json& tuning);

/// Chooses settings by search_settings(), the penalty too if `tunes_penalty`. Trials are made on
/// some rows in the middle, without the views that `measurement` holds out to score the result.
/// Finished trials go to `file`; those found there are not repeated. Returns nothing if a stop
/// was requested. Throws Error for too few views.
std::optional<TunedFit> tune(
    const measurement::Measurement& measurement, const fit::FieldOptions& field,
    const fit::FitOptions& fit, bool tunes_penalty, selection::TrialFile& file,
    const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Chooses the penalty alone, by choose_penalty(): two trials on half as many rows with plain
/// vertices, whatever the field. Which penalty is right depends on the specimen, and plain vertices
/// converge in a fraction of the time: a few per cent of a fit of 256 rows. Returns nothing if a
/// stop was requested.
std::optional<TunedFit> tune_penalty(
    const measurement::Measurement& measurement, const fit::FieldOptions& field,
    const fit::FitOptions& fit, const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::reconstruction
