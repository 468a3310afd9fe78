#pragma once

#include <optional>
#include <string>

#include "tomofield/options.h"
#include "tune/trials.h"

namespace tomofield::tune {

/// The settings that trials choose. They replace options of the run.
struct TrialSettings {
  Penalty penalty = Penalty::kConcave;  ///< FitOptions::penalty
  double variation = 0;                 ///< FitOptions::density_variation
  int rank = 0;                         ///< FieldOptions::rank
  int epochs = 0;                       ///< FitOptions::epochs; the learning rate decays over these
  bool fits_view_scale = false;         ///< FitOptions::fit_view_scale
  double background_part = 0;           ///< that is subtracted (measurement/background.h)
  bool masks_beads = false;             ///< whose search left that open (undecided_beads.h)
  int spike_rank = FitOptions{}.spike_rank;  ///< FitOptions::spike_rank
  Prior prior = Prior::kTv;                  ///< FitOptions::prior
  bool operator==(const TrialSettings&) const = default;
};
using FitTrial = Trial<TrialSettings>;
using FitTrials = Trials<TrialSettings>;
using TunedFit = Tuned<TrialSettings>;

/// Prepares the trials of a search; `run` makes some trials. Settings whose weights differ by
/// rounding count as equal.
FitTrials make_trials(FitTrials::RunTrials run);

/// Returns the trial that has the chosen settings, or null if there is none. Short trials have
/// fewer epochs than the fit, so epochs count only if a trial has those that were chosen.
const FitTrial* chosen_trial(const TunedFit& tuned);

/// Returns true if a trial differs from the first one of its search in nothing but the penalty and
/// the weight of total variation.
bool differs_from_first_in_variation_alone(const FitTrial& trial, const TunedFit& tuned);

/// Compares a trial with the chosen one, patch by patch. If the chosen settings are a mixture that
/// no trial has, compares it with the trial that predicts best.
Difference difference_to_chosen(const FitTrial& trial, const TunedFit& tuned);

/// Returns by what part the learned prior lowers the error of held-out views in the last trials, of
/// which the first has total variation alone; none if no trials compared them.
std::optional<Difference> gain_of_prior(const TunedFit& tuned);

/// Describes settings as in "smooth tv 5", and which corrections of the views differ from those of
/// `usual`.
std::string describe(const TrialSettings& settings, const TrialSettings& usual);

}  // namespace tomofield::tune
