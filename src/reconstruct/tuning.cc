#include "reconstruct/tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "base/enum_names.h"
#include "base/log.h"
#include "objective/options.h"
#include "reconstruct/trial_fits.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {
namespace {

using nlohmann::json;

// Trials that compare penalties need fewer rows and epochs than others, since penalties differ by
// more than weights do.
constexpr std::int64_t kPenaltyRows = 32;
constexpr double kPenaltyPart = 0.5;  // part of the epochs that plain vertices need

TrialSettings settings_from(const json& entry) {
  return {.penalty = base::enum_named<Penalty>(entry.at("tv_penalty").get<std::string>()).value(),
          .variation = entry.at("tv"),
          .rank = entry.at("rank"),
          .epochs = entry.at("epochs")};
}

// Returns the options of a trial with plain vertices: half their usual schedule. If `fit` is
// shorter than usual for `field`, the trial is shorter in proportion.
fit::FitOptions penalty_trial_options(const fit::FieldOptions& plain,
                                      const fit::FieldOptions& field, const fit::FitOptions& fit) {
  const fit::Schedule usual = fit::usual_schedule(plain, fit);
  const double part =
      std::min(1.0, static_cast<double>(fit.epochs) / fit::usual_schedule(field, fit).epochs);
  fit::FitOptions shorter = fit;
  shorter.epochs = std::max(1, static_cast<int>(std::lround(kPenaltyPart * part * usual.epochs)));
  if (fit.coarse_epochs > 0) shorter.coarse_epochs = usual.coarse_epochs_of(shorter.epochs);
  shorter.vertex_epochs = 0;
  shorter.learning_rate = usual.learning_rate;
  return shorter;
}

// Searches on every process, with the same trials and so with the same result. Returns nothing if a
// stop was requested.
std::optional<TunedFit> searched(TrialFits& fits, selection::TrialFile* file,
                                 const std::function<TrialSettings(FitTrials&)>& search) {
  FitTrials trials =
      make_trials([&](const std::vector<TrialSettings>& batch) { return fits.run(batch, file); });
  try {
    const TrialSettings found = search(trials);
    return TunedFit{found, trials.made(), fits.predicted_views()};
  } catch (const StopRequested&) {
    return std::nullopt;
  }
}

void log_trials(const std::vector<FitTrial>& trials) {
  for (const FitTrial& t : trials) {
    base::log_info(fmt::format("tried {} tv {:8.3f}  rank {:3}  epochs {:4}: held-out error {:.5f}",
                               base::name_of(t.settings.penalty), t.settings.variation,
                               t.settings.rank, t.settings.epochs, t.score.error));
  }
}

}  // namespace

FitTrial trial_from(const json& entry) {
  return {.settings = settings_from(entry),
          .score = selection::score_from(entry),
          .seconds = entry.value("seconds", 0.0)};
}

json settings_json(const TrialSettings& s) {
  return {{"tv_penalty", base::name_of(s.penalty)},
          {"tv", s.variation},
          {"rank", s.rank},
          {"epochs", s.epochs}};
}

FitTrials make_trials(FitTrials::RunTrials run) {
  constexpr double kRounding = 1e-9;
  return {std::move(run), [](const TrialSettings& a, const TrialSettings& b) {
            return a.penalty == b.penalty && a.rank == b.rank && a.epochs == b.epochs &&
                   std::abs(a.variation / b.variation - 1) < kRounding;
          }};
}

TrialSettings choose_penalty(const TrialSettings& start, FitTrials& trials) {
  TrialSettings concave = start, smooth = start;
  concave.penalty = Penalty::kConcave;
  smooth.penalty = Penalty::kSmooth;
  for (TrialSettings* settings : {&concave, &smooth})
    settings->variation = objective::usual_variation(settings->penalty);
  return trials.first_as_good({smooth, concave});
}

TrialSettings choose_variation(const TrialSettings& start, FitTrials& trials) {
  const TrialSettings chosen = choose_penalty(start, trials);
  if (chosen.penalty == Penalty::kConcave) return chosen;
  std::vector<TrialSettings> candidates;
  for (const double factor : {3.2, 1.8, 1.0, 0.56}) {
    candidates.push_back(chosen);
    candidates.back().variation *= factor;
  }
  return trials.first_as_good(candidates);
}

int expected_trials(const SearchSpace& space) {
  return selection::kUsualWeights + 2 + (space.penalty ? 1 : 0) + (space.rank ? 2 : 0);
}

TrialSettings search_settings(const TrialSettings& start, const SearchSpace& space,
                              FitTrials& trials) {
  TrialSettings best = space.penalty ? choose_penalty(start, trials) : start;
  best = trials.with_best_weight(best, best.variation, [](TrialSettings& settings, double weight) {
    settings.variation = weight;
  });
  if (space.rank) {
    std::vector<TrialSettings> candidates;
    for (const int thirds : {1, 2, 3}) {
      candidates.push_back(best);
      candidates.back().rank = std::max(thirds * best.rank / 3, 1);
    }
    best = trials.first_as_good(candidates);
  }
  std::vector<TrialSettings> candidates;
  for (const int epochs : {std::max(best.epochs / 2, 1), best.epochs, 2 * best.epochs}) {
    candidates.push_back(best);
    candidates.back().epochs = epochs;
  }
  return trials.first_as_good(candidates);
}

json tuning_json(const TunedFit& tuned) { return selection::tuned_json(tuned, settings_json); }

TunedFit tuned_from(const json& tuning) {
  TunedFit tuned{.settings = settings_from(tuning.at("chosen")),
                 .trials = {},
                 .predicted_views = tuning.at("predicted_views")};
  for (const json& trial : tuning.at("trials")) tuned.trials.push_back(trial_from(trial));
  return tuned;
}

std::optional<TunedFit> tune(const measurement::Measurement& measurement,
                             const fit::FieldOptions& field, const fit::FitOptions& fit,
                             bool tunes_penalty, selection::TrialFile& file, const TuneHooks& hooks,
                             const distributed::Communicator& processes) {
  const SearchSpace space{.penalty = tunes_penalty, .rank = field.kind == FieldKind::kVm};
  TrialFits fits(measurement, selection::kTrialRows, field, fit, hooks, expected_trials(space),
                 processes);
  // A run without total variation still needs a weight to search from.
  const double first =
      fit.density_variation > 0 ? fit.density_variation : objective::usual_variation(fit.penalty);
  const std::optional<TunedFit> tuned = searched(fits, &file, [&](FitTrials& trials) {
    return search_settings({fit.penalty, first, field.rank, fit.epochs}, space, trials);
  });
  if (!tuned) return std::nullopt;
  log_trials(tuned->trials);
  base::log_info(fmt::format(
      "tuned: --tv-penalty {} --tv {:.3f} --rank {} --epochs {} "
      "--vertex-epochs {} --coarse-epochs {}",
      base::name_of(tuned->settings.penalty), tuned->settings.variation, tuned->settings.rank,
      tuned->settings.epochs, fit.vertex_epochs, fit.coarse_epochs));
  return tuned;
}

std::optional<TunedFit> tune_penalty(const measurement::Measurement& measurement,
                                     const fit::FieldOptions& field, const fit::FitOptions& fit,
                                     const TuneHooks& hooks,
                                     const distributed::Communicator& processes) {
  fit::FieldOptions plain = field;
  plain.kind = FieldKind::kGrid;
  const fit::FitOptions shorter = penalty_trial_options(plain, field, fit);
  TrialFits fits(measurement, kPenaltyRows, plain, shorter, hooks, 2, processes);
  std::optional<TunedFit> tuned = searched(fits, nullptr, [&](FitTrials& trials) {
    return choose_variation({fit.penalty, fit.density_variation, field.rank, shorter.epochs},
                            trials);
  });
  if (!tuned) return std::nullopt;
  log_trials(tuned->trials);
  tuned->settings.epochs = fit.epochs;
  return tuned;
}

}  // namespace tomofield::reconstruction
