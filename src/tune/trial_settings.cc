#include "tune/trial_settings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/enum_names.h"

namespace tomofield::tune {
namespace {

// Says whether settings are equal. Weights may differ by rounding.
bool are_equal(const TrialSettings& a, const TrialSettings& b) {
  constexpr double kRounding = 1e-9;
  TrialSettings same_weight = a;
  same_weight.variation = b.variation;
  return same_weight == b &&
         std::abs(a.variation - b.variation) <= kRounding * std::abs(b.variation);
}

}  // namespace

FitTrials make_trials(FitTrials::RunTrials run) { return {std::move(run), are_equal}; }

const FitTrial* chosen_trial(const TunedFit& tuned) {
  const auto find = [&](bool with_epochs) {
    return std::ranges::find_if(tuned.trials, [&](const FitTrial& trial) {
      TrialSettings settings = trial.settings;
      settings.prior = tuned.settings.prior;  // these trials end with total variation
      if (!with_epochs) settings.epochs = tuned.settings.epochs;
      return are_equal(settings, tuned.settings);
    });
  };
  auto chosen = find(true);
  if (chosen == tuned.trials.end()) chosen = find(false);
  return chosen == tuned.trials.end() ? nullptr : &*chosen;
}

bool differs_from_first_in_variation_alone(const FitTrial& trial, const TunedFit& tuned) {
  TrialSettings first = tuned.trials.front().settings;
  first.penalty = trial.settings.penalty;
  first.variation = trial.settings.variation;
  return trial.settings == first;
}

Difference difference_to_chosen(const FitTrial& trial, const TunedFit& tuned) {
  if (const FitTrial* const chosen = chosen_trial(tuned))
    return difference(trial.score, chosen->score);
  const FitTrial& best = *std::ranges::min_element(tuned.trials, {}, [&](const FitTrial& t) {
    return difference(t.score, tuned.trials.front().score).log_ratio;
  });
  return difference(trial.score, best.score);
}

std::optional<Difference> gain_of_prior(const TunedFit& tuned) {
  if (tuned.last_trials.empty()) return std::nullopt;
  return difference_of_means(tuned.last_trials.front().score, tuned.last_trials.back().score);
}

std::string describe(const TrialSettings& settings, const TrialSettings& usual) {
  std::string text =
      fmt::format("{} tv {:.3g}", base::name_of(settings.penalty), settings.variation);
  if (settings.fits_view_scale != usual.fits_view_scale)
    text += settings.fits_view_scale ? ", view scales" : ", no view scales";
  if (settings.masks_beads != usual.masks_beads)
    text += settings.masks_beads ? ", beads masked" : ", beads not masked";
  if (settings.spike_rank != usual.spike_rank)
    text += settings.spike_rank == 0 ? std::string(", spikes kept")
                                     : fmt::format(", spike rank {}", settings.spike_rank);
  if (settings.background_part != usual.background_part)
    text += fmt::format(", {:.0f} % of the background subtracted", 100 * settings.background_part);
  return text;
}

}  // namespace tomofield::tune
