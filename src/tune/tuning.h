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
/// Returns the trials of a search (choose_settings()): whole_trial() with --tune, else short fits
/// with plain vertices. Transfers that move what is in a view by up to `reach_px` make the rows so
/// near to the ends of a strip depend on rows outside, so a short strip is higher by that at both
/// ends, up to 8 rows.
TrialShape search_trial(const FieldOptions& field, const FitOptions& fit,
                        std::int64_t reach_px = 0);

/// Returns a whole fit of some rows. Trials of the learned prior are such, since the end of a fit
/// is what that replaces.
TrialShape whole_trial(const FieldOptions& field, const FitOptions& fit);

/// Returns what trials can choose of `wanted`: there must be a background or undecided beads.
OpenSettings open_settings(OpenSettings wanted, const measurement::Measurement& measurement);

/// Chooses the open settings of a fit by trials on some rows in the middle, without the views that
/// `measurement` holds out to score the result. It chooses, one after another,
///
///   1. total variation: with --tune by search_settings(), with the penalty only if `open` has the
///      variation; else as choose_variation() does, if `open` has it,
///   2. the limit of spikes and the corrections of the views that are open (automatic_choice.h),
///   3. the prior, if it is open, by two trials of whole_trial() with the settings chosen so far.
///      The learned prior is taken if it predicts better.
///
/// Without --tune the trials use plain vertices, whatever the field of the run: the right settings
/// depend on the specimen, and plain vertices converge in a fraction of the time. Each takes about
/// 3 % of a fit of 256 rows.
///
/// `file`, which may be null, stores finished trials; those that it has are not repeated. Returns
/// nothing if a stop was requested. Throws Error for too few views. Every process calls it.
std::optional<TunedFit> choose_settings(
    const measurement::Measurement& measurement, const FieldOptions& field, const FitOptions& fit,
    const OpenSettings& open, TrialFile* file, const TuneHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::tune
