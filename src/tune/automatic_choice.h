#pragma once

#include "tune/trial_settings.h"

namespace tomofield::tune {

/// The settings that a run leaves to trials.
struct OpenSettings {
  bool variation = false;   ///< penalty and weight of total variation
  bool spikes = false;      ///< the limit of isolated vertices
  bool view_scale = false;  ///< scales and offsets of the views
  bool background = false;  ///< subtraction of the series' background
  bool beads = false;       ///< masks of the beads that were found
  bool prior = false;       ///< the learned prior, once the others are chosen
  /// Returns true if there is one but for the prior, which has trials of its own.
  bool any() const { return variation || spikes || view_scale || background || beads; }
  bool operator==(const OpenSettings&) const = default;
};

/// Number of standard errors beyond which one trial counts as better than another. Trials predict
/// few views, so that one standard error is passed by chance too often.
constexpr double kClearErrors = 2;

/// Returns `settings` with all corrections of the views that are open: scales and masks of beads
/// do no harm where they are not needed, while a wrong penalty can be chosen without them.
TrialSettings with_safe_corrections(TrialSettings settings, const OpenSettings& open);

/// Chooses the penalty of total variation, each with its usual weight: the concave one if it
/// predicts better by three standard errors and by 1 %, else the smooth one. A concave penalty
/// makes sharp edges, which are right for some specimens only; where held-out views cannot tell, it
/// paints flat regions that are none.
TrialSettings choose_penalty(const TrialSettings& start, FitTrials& trials);

/// Chooses penalty and weight of total variation:
///
///   1. Weights of the smooth penalty are tried in factors of 1.8 about the usual one, until the
///      best has a worse one on either side. The weight is where a parabola through all scores is
///      lowest (tune/lowest_loss.h), so that chance in the scores changes it little.
///   2. The concave penalty with its usual weight replaces it as in choose_penalty(), if a smaller
///      weight of it predicts clearly worse. Else it keeps grains of noise as if they were objects,
///      and leaves isolated voxels. A larger weight replaces the usual one as in choose_penalty(),
///      or if it is as good and its volume is clearly cleaner (fewer than half of the isolated
///      voxels, or leaves that do not show).
TrialSettings choose_variation(const TrialSettings& start, FitTrials& trials);

/// Chooses whether isolated vertices are limited in a smooth fit: not if that predicts better by
/// three standard errors and by 1 %, as where the peaks of atoms are as narrow as a vertex. Concave
/// fits keep the limit, which they need on every yardstick.
TrialSettings choose_spike_rank(const TrialSettings& start, FitTrials& trials);

/// Chooses the corrections of the views that are open, each by trials that differ in it alone.
/// Scales are fitted if that is clearly better. Beads are masked unless a fit to them is clearly
/// better: they were found because they clearly are beads, few trials show how they streak, and
/// particles that are the specimen help to predict what is around them. Of the background, trials
/// subtract half, and all of it if that is better; the part that is subtracted is interpolated
/// between them.
TrialSettings choose_corrections(const TrialSettings& start, const OpenSettings& open,
                                 FitTrials& trials);

constexpr int kPriorTrials = 2;
/// Chooses whether the learned prior ends the fit: if it lowers the error of held-out views, or
/// raises it by less than the standard error. Where these views cannot tell, the volume with less
/// noise is the better guess. The trials must be whole fits, since the end of a fit is what the
/// prior replaces.
TrialSettings choose_prior(const TrialSettings& start, FitTrials& trials);

/// Returns the number of trials that the functions above, but for choose_prior(), usually make for
/// what is open.
int usual_trials(const OpenSettings& open);

}  // namespace tomofield::tune
