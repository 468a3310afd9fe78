#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "base/progress.h"
#include "fit/fit.h"
#include "tune/automatic_choice.h"
#include "tune/trial_file.h"
#include "tune/trial_settings.h"

namespace tomofield::tune {

/// What a search may change in addition to the weight and the epochs.
struct SearchSpace {
  bool penalty = true;  ///< compare the concave and the smooth penalty
  bool rank = true;     ///< compare ranks; the field must have one
};

/// Chooses the settings that predict held-out views best, one after another:
///
///   1. the penalty, as choose_penalty() does,
///   2. the weight of total variation (search_weight),
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

/// The callbacks of a search. They are called in the thread that searches.
struct TuneHooks {
  base::ProgressSink progress;
  std::function<bool()> stop_requested;  ///< is asked after every step
};

/// The size of one trial of a search: a fit of at most `rows` rows with these options.
struct TrialShape {
  std::int64_t rows = 0;
  FieldOptions field;
  FitOptions fit;
};
/// Returns the trials that tune() makes of a run.
TrialShape trial_of_tune(const FieldOptions& field, const FitOptions& fit);
/// Returns the trials that choose_by_short_trials() makes of a run whose transfers move what is in
/// a view by up to `reach_px`. Rows so near to the ends of a strip depend on rows outside, so the
/// strip is higher by that at both ends, up to 8 rows.
TrialShape short_trial(const FieldOptions& field, const FitOptions& fit, std::int64_t reach_px = 0);

/// Returns the trials that say whether the learned prior helps a run: whole fits of some rows with
/// plain vertices. Shorter ones say nothing of it, since the end of a fit is what it replaces.
TrialShape prior_trial(const FieldOptions& field, const FitOptions& fit);

/// Returns what trials can choose of `wanted`: there must be a background or undecided beads.
OpenSettings open_settings(OpenSettings wanted, const measurement::Measurement& measurement);

/// Chooses settings by search_settings(), and then the prior as choose_by_short_trials() does; the
/// penalty only if `open` has the variation. Chooses the
/// corrections of the views that are open after that. Trials use some rows in the middle and none
/// of the views that `measurement` holds out to score the result. `file` stores finished trials,
/// and trials that it has are not repeated. Returns nothing if a stop was requested. Throws Error
/// for too few views. Every process calls it.
std::optional<TunedFit> tune(
    const measurement::Measurement& measurement, const FieldOptions& field, const FitOptions& fit,
    const OpenSettings& open, TrialFile& file, const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Chooses the open settings by short trials (automatic_choice.h). The trials use plain vertices,
/// whatever the field of the run: the right settings depend on the specimen, and plain vertices
/// converge in a fraction of the time. Each trial takes about 3 % of a fit of 256 rows. If the
/// prior is open, two trials of prior_trial() follow, with the chosen settings, and the learned
/// prior is taken if it predicts better. Returns nothing if a stop was requested. Every process
/// calls it.
std::optional<TunedFit> choose_by_short_trials(
    const measurement::Measurement& measurement, const FieldOptions& field, const FitOptions& fit,
    const OpenSettings& open, const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::tune
