#include "tune/tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "base/enum_names.h"
#include "base/log.h"
#include "measurement/surrogate_views.h"
#include "objective/constants.h"
#include "tune/trial_fits.h"

namespace tomofield::tune {
namespace {

// Short trials: with these rows and parts of the usual epochs, weights rank as after whole fits.
constexpr std::int64_t kShortRows = 32;
// More rows at the ends choose no better weights (docs/results/ctf.md, "Trials").
constexpr std::int64_t kMostRowsBeside = 8;
constexpr double kShortPart = 0.2, kShortCoarsePart = 0.25;

// Returns the options of a short trial with plain vertices. If `fit` is shorter than usual for
// `field`, the trial is shorter in proportion.
FitOptions short_trial_options(const FieldOptions& plain, const FieldOptions& field,
                               const FitOptions& fit) {
  const fit::Schedule usual = fit::usual_schedule(plain, fit);
  const double part =
      std::min(1.0, static_cast<double>(fit.epochs) / fit::usual_schedule(field, fit).epochs);
  const auto epochs = [&](double of_usual) {
    return std::max(1, static_cast<int>(std::lround(part * of_usual)));
  };
  FitOptions shorter = fit;
  shorter.epochs = epochs(kShortPart * usual.epochs);
  if (fit.coarse_epochs > 0)
    shorter.coarse_epochs = epochs(kShortCoarsePart * usual.coarse_epochs_of(usual.epochs));
  shorter.vertex_epochs = 0;
  shorter.learning_rate = usual.learning_rate;
  return shorter;
}

// Searches on every process, with the same trials and so with the same result. Returns nothing if a
// stop was requested.
std::optional<TunedFit> searched(TrialFits& fits, TrialFile* file,
                                 const std::function<TrialSettings(FitTrials&)>& search) {
  FitTrials trials =
      make_trials([&](const std::vector<TrialSettings>& batch) { return fits.run(batch, file); });
  try {
    const TrialSettings found = search(trials);
    return TunedFit{found, trials.made(), fits.predicted_views()};
  } catch (const base::StopRequested&) {
    return std::nullopt;
  }
}

// Says how the trial with the learned prior compares with that without it.
void log_prior(const TunedFit& tuned) {
  const Difference gain = gain_of_prior(tuned).value();
  base::log_info(fmt::format(
      "learned prior: in fits of some rows it changes the error of the views left out by "
      "{:+.2f} % ± {:.2f}: {}",
      -100 * gain.log_ratio, 100 * gain.standard_error,
      tuned.settings.prior == Prior::kLearned ? "it ends the fit"
                                              : "total variation alone ends the fit"));
}

// Compares fits with and without the learned prior, if that is open.
std::optional<TunedFit> with_prior(std::optional<TunedFit> tuned,
                                   const measurement::Measurement& measurement,
                                   const FieldOptions& field, const FitOptions& fit,
                                   const OpenSettings& open, TrialFile* file,
                                   const TuneHooks& hooks,
                                   const distributed::Communicator& processes) {
  if (!tuned || !open.prior) return tuned;
  const TrialShape shape = whole_trial(field, fit);
  TrialFits fits(measurement, shape.rows, shape.field, shape.fit,
                 open.view_scale || fit.fit_view_scale, hooks, kPriorTrials, processes);
  const std::optional<TunedFit> compared = searched(
      fits, file, [&](FitTrials& trials) { return choose_prior(tuned->settings, trials); });
  if (!compared) return std::nullopt;
  tuned->settings.prior = compared->settings.prior;
  tuned->last_trials = compared->trials;
  log_prior(*tuned);
  return tuned;
}

// Writes a line for each trial: its settings, and how much worse than the chosen one it predicts.
// Says how these are compared.
void log_trials(const TunedFit& tuned, FieldKind kind) {
  const char* const reference =
      chosen_trial(tuned) != nullptr ? "the chosen settings" : "the best trial";
  for (const FitTrial& t : tuned.trials) {
    const Difference d = difference_to_chosen(t, tuned);
    base::log_info(fmt::format(
        "tried {}{}, epochs {}: patch by patch {:+.2f} % ± {:.2f} from "
        "{}; mean held-out error {:.5f}{}",
        describe(t.settings, tuned.trials.front().settings),
        kind == FieldKind::kVm ? fmt::format(", rank {}", t.settings.rank) : "", t.settings.epochs,
        100 * d.log_ratio, 100 * d.standard_error, reference, t.score.error,
        t.score.speckle ? fmt::format(", speckle {:.3f} %", 100 * *t.score.speckle)
                        : std::string()));
  }
  base::log_info(
      "the choice compares the errors of trials patch by patch of the views left out (median over "
      "pairs of patches); a patch that all predict badly moves the mean error, but not this");
}

TrialShape short_trial(const FieldOptions& field, const FitOptions& fit, std::int64_t reach_px) {
  FieldOptions plain = field;
  plain.kind = FieldKind::kGrid;
  return {kShortRows + 2 * std::min(reach_px, kMostRowsBeside), plain,
          short_trial_options(plain, field, fit)};
}

// How a search looks for the weight of total variation and what it chooses with that.
struct Search {
  int num_trials = 0;
  double first_variation = 0;
  std::function<TrialSettings(const TrialSettings& start, FitTrials& trials)> choose_variation;
};

Search thorough_search(const FieldOptions& field, const FitOptions& fit, const OpenSettings& open) {
  const SearchSpace space{.penalty = open.variation, .rank = field.kind == FieldKind::kVm};
  // A run without total variation still needs a weight to search from.
  const double first =
      fit.density_variation > 0 ? *fit.density_variation : objective::usual_variation(fit.penalty);
  return {expected_trials(space), first, [space](const TrialSettings& start, FitTrials& trials) {
            return search_settings(start, space, trials);
          }};
}

Search short_search(const FitOptions& fit, const OpenSettings& open) {
  const bool is_open = open.variation;
  return {usual_trials(open), *fit.density_variation,
          [is_open](const TrialSettings& start, FitTrials& trials) {
            return is_open ? choose_variation(start, trials) : start;
          }};
}

// Says what was chosen, in the words of log_trials().
void log_choice(const TunedFit& tuned, const FitOptions& fit) {
  const TrialSettings& chosen = tuned.settings;
  if (!fit.tune) return base::log_info("chose " + describe(chosen, tuned.trials.front().settings));
  base::log_info(
      fmt::format("tuned: --tv-penalty {} --tv {:.3f} --rank {} --epochs {} "
                  "--vertex-epochs {} --coarse-epochs {}",
                  base::name_of(chosen.penalty), chosen.variation, chosen.rank, chosen.epochs,
                  fit.vertex_epochs, fit.coarse_epochs));
}

}  // namespace

int expected_trials(const SearchSpace& space) {
  return kUsualWeights + 2 + (space.penalty ? 1 : 0) + (space.rank ? 2 : 0);
}

TrialShape search_trial(const FieldOptions& field, const FitOptions& fit, std::int64_t reach_px) {
  return fit.tune ? whole_trial(field, fit) : short_trial(field, fit, reach_px);
}

TrialShape whole_trial(const FieldOptions& field, const FitOptions& fit) {
  return {kTrialRows, field, fit};
}

OpenSettings open_settings(OpenSettings wanted, const measurement::Measurement& measurement) {
  wanted.background = wanted.background && measurement.background != 0.0;
  wanted.beads = wanted.beads && !measurement.undecided_beads.empty();
  return wanted;
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

std::optional<TunedFit> choose_settings(const measurement::Measurement& measurement,
                                        const FieldOptions& field, const FitOptions& fit,
                                        const OpenSettings& open, TrialFile* file,
                                        const TuneHooks& hooks,
                                        const distributed::Communicator& processes) {
  const Search search = fit.tune ? thorough_search(field, fit, open) : short_search(fit, open);
  const TrialShape shape = search_trial(field, fit, measurement::largest_reach_px(measurement));
  TrialFits fits(measurement, shape.rows, shape.field, shape.fit,
                 open.view_scale || fit.fit_view_scale, hooks, search.num_trials, processes);
  const TrialSettings start = with_safe_corrections({.penalty = fit.penalty,
                                                     .variation = search.first_variation,
                                                     .rank = field.rank,
                                                     .epochs = shape.fit.epochs,
                                                     .fits_view_scale = fit.fit_view_scale,
                                                     .spike_rank = fit.spike_rank},
                                                    open);
  std::optional<TunedFit> tuned = searched(fits, file, [&](FitTrials& trials) {
    TrialSettings best = search.choose_variation(start, trials);
    if (open.spikes) best = choose_spike_rank(best, trials);
    return choose_corrections(best, open, trials);
  });
  if (!tuned) return std::nullopt;
  log_trials(*tuned, field.kind);
  log_choice(*tuned, fit);
  if (!fit.tune) tuned->settings.epochs = fit.epochs;
  return with_prior(std::move(tuned), measurement, field, fit, open, file, hooks, processes);
}

}  // namespace tomofield::tune
