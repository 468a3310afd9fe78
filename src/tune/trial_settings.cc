#include "tune/trial_settings.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/enum_names.h"
#include "base/plausible.h"
#include "io/json_numbers.h"
#include "kernels/spikes.h"
#include "tomofield/error.h"
#include "tune/trial_file.h"

namespace tomofield::tune {
namespace {

using nlohmann::json;

constexpr std::int64_t kMostOfAnything = 1000000000;

TrialSettings settings_from(const json& entry) {
  const auto penalty = base::enum_named<Penalty>(entry.at("tv_penalty").get<std::string>());
  if (!penalty) throw Error("'tv_penalty' is no penalty");
  const auto prior = base::enum_named<Prior>(entry.at("prior").get<std::string>());
  if (!prior) throw Error("'prior' is no prior");
  return {.penalty = *penalty,
          .variation = io::number_at(entry, "tv", 0, base::kLargestNumber),
          .rank = static_cast<int>(io::integer_at(entry, "rank", 1, kMostOfAnything)),
          .epochs = static_cast<int>(io::integer_at(entry, "epochs", 1, kMostOfAnything)),
          .fits_view_scale = entry.at("view_scale"),
          .background_part = io::number_at(entry, "background_part", 0, 1),
          .masks_beads = entry.at("masks_beads"),
          .spike_rank =
              static_cast<int>(io::integer_at(entry, "spike_rank", 0, kernels::kMostSpikeRank)),
          .prior = *prior};
}

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

json settings_json(const TrialSettings& s) {
  return {{"tv_penalty", base::name_of(s.penalty)},
          {"tv", s.variation},
          {"rank", s.rank},
          {"epochs", s.epochs},
          {"view_scale", s.fits_view_scale},
          {"background_part", s.background_part},
          {"masks_beads", s.masks_beads},
          {"spike_rank", s.spike_rank},
          {"prior", base::name_of(s.prior)}};
}

FitTrial trial_from(const json& entry) {
  return {.settings = settings_from(entry),
          .score = score_from(entry),
          .seconds = entry.contains("seconds")
                         ? io::number_at(entry, "seconds", 0, base::kLargestNumber)
                         : 0.0};
}

json tuning_json(const TunedFit& tuned) {
  json tuning = tuned_json(tuned, settings_json);
  for (std::size_t i = 0; i < tuned.trials.size(); ++i) {
    const Difference d = difference_to_chosen(tuned.trials[i], tuned);
    tuning["trials"][i].update(
        {{"above_chosen", d.log_ratio}, {"standard_error", d.standard_error}});
  }
  return tuning;
}

TunedFit tuned_from(const json& tuning) {
  TunedFit tuned{
      .settings = settings_from(tuning.at("chosen")), .trials = {}, .predicted_views = {}};
  for (const double view : io::numbers_at(tuning, "predicted_views", 0, base::kLargestNumber))
    tuned.predicted_views.push_back(static_cast<int>(view));
  for (const json& trial : tuning.at("trials")) tuned.trials.push_back(trial_from(trial));
  for (const json& trial : tuning.at("last_trials")) tuned.last_trials.push_back(trial_from(trial));
  return tuned;
}

}  // namespace tomofield::tune
