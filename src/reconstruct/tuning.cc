#include "reconstruct/tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "base/enum_names.h"
#include "base/log.h"
#include "base/stopwatch.h"
#include "objective/options.h"
#include "selection/trial_measurement.h"
#include "tomofield/error.h"
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

FitTrial trial_from(const json& entry) {
  return {.settings = settings_from(entry),
          .score = selection::score_from(entry),
          .seconds = entry.value("seconds", 0.0)};
}

// Holds the part of a measurement that trials use.
struct Strip {
  selection::TrialViews views;
  measurement::Measurement measurement;
  double part = 1;  // number of its rows over that of all rows
};

Strip middle_strip(const measurement::Measurement& whole, std::int64_t max_rows,
                   const distributed::Communicator& processes) {
  Strip strip{.views = selection::trial_views(whole.geometry.tilt_deg, whole.held_out),
              .measurement = {}};
  strip.measurement = selection::trial_measurement(whole, strip.views, max_rows, processes);
  strip.part = static_cast<double>(strip.measurement.rays->shape().num_rows) /
               static_cast<double>(whole.rays->shape().num_rows);
  return strip;
}

struct StopRequested {};

// Makes the trials of a search, with its progress.
class TrialFits {
 public:
  TrialFits(const measurement::Measurement& measurement, std::int64_t rows,
            const fit::FieldOptions& field, const fit::FitOptions& fit, const TuneHooks& hooks,
            int num_expected, const distributed::Communicator& processes)
      : strip_(middle_strip(measurement, rows, processes)),
        field_(field),
        fit_(fit),
        hooks_(hooks),
        num_expected_(num_expected) {}

  FitTrial run(const TrialSettings& settings) {
    FitTrial trial = fitted(settings);
    ++num_done_;
    return trial;
  }

  // Returns the trial from `file`, or makes it and adds it to the file.
  FitTrial run(const TrialSettings& settings, selection::TrialFile& file) {
    if (const auto known = file.find(settings_json(settings))) {
      ++num_done_;
      return trial_from(*known);
    }
    FitTrial trial = run(settings);
    file.add(selection::trial_json(settings_json(settings), trial.score, trial.seconds));
    return trial;
  }

  const std::vector<int>& predicted_views() const { return strip_.views.predicted; }

 private:
  FitTrial fitted(const TrialSettings& settings) {
    fit::FieldOptions field = field_;
    fit::FitOptions options = fit_;
    field.rank = settings.rank;
    field.leaf_budget = static_cast<int>(std::ceil(field.leaf_budget * strip_.part));
    options.penalty = settings.penalty;
    options.density_variation = settings.variation;
    options.epochs = settings.epochs;
    options.patience = 0;
    const base::Stopwatch running;
    fit::Fit fit(strip_.measurement, field, options);
    fit.run([&](const fit::Fit&) {
      if (hooks_.stop_requested && hooks_.stop_requested()) throw StopRequested();
      if (hooks_.progress) hooks_.progress(report(fit, settings));
      return true;
    });
    const measurement::ViewErrors error = fit.held_out_error();
    return {settings, {error.total, error.view_error}, running.seconds()};
  }

  base::ProgressReport report(const fit::Fit& fit, const TrialSettings& settings) const {
    const int expected = std::max(num_expected_, num_done_ + 1);
    const double of_trial = fit.work(fit.progress().step) / fit.work(fit.num_steps());
    const auto& errors = fit.progress().held_out_error;
    return base::progress_at(
        (num_done_ + of_trial) / expected, running_.seconds(),
        fmt::format("trial {}/{}  {} tv {:.3g}  rank {}  epochs {}  held out {}", num_done_ + 1,
                    expected, base::name_of(settings.penalty), settings.variation, settings.rank,
                    settings.epochs, errors.empty() ? "-" : fmt::format("{:.4f}", errors.back())));
  }

  Strip strip_;
  const fit::FieldOptions& field_;
  const fit::FitOptions& fit_;
  const TuneHooks& hooks_;
  base::Stopwatch running_;
  int num_expected_;
  int num_done_ = 0;
};

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

// Lets the root search, and broadcasts the result: trials are too small for several processes.
// Returns nothing if a stop was requested.
std::optional<TunedFit> search_on_root(const distributed::Communicator& processes,
                                       const std::function<TunedFit()>& search) {
  std::optional<TunedFit> tuned;
  json found = nullptr;
  processes.run_collectively([&] {
    if (!processes.is_root()) return;
    try {
      tuned = search();
    } catch (const StopRequested&) {
      return;
    }
    found = tuning_json(*tuned);
  });
  found = json::parse(processes.broadcast(found.dump()));
  if (processes.is_root() || found.is_null()) return tuned;
  return tuned_from(found);
}

void log_trials(const std::vector<FitTrial>& trials) {
  for (const FitTrial& t : trials) {
    base::log_info(fmt::format("tried {} tv {:8.3f}  rank {:3}  epochs {:4}: held-out error {:.5f}",
                               base::name_of(t.settings.penalty), t.settings.variation,
                               t.settings.rank, t.settings.epochs, t.score.error));
  }
}

}  // namespace

json settings_json(const TrialSettings& s) {
  return {{"tv_penalty", base::name_of(s.penalty)},
          {"tv", s.variation},
          {"rank", s.rank},
          {"epochs", s.epochs}};
}

FitTrials make_trials(FitTrials::RunTrial run) {
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
  return trials.preferred_by_most_views(concave, smooth);
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
  const auto search = [&] {
    FitTrials trials =
        make_trials([&](const TrialSettings& settings) { return fits.run(settings, file); });
    const TrialSettings found =
        search_settings({fit.penalty, first, field.rank, fit.epochs}, space, trials);
    return TunedFit{found, trials.made(), fits.predicted_views()};
  };
  const std::optional<TunedFit> tuned = search_on_root(processes, search);
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
  const auto search = [&] {
    FitTrials trials =
        make_trials([&](const TrialSettings& settings) { return fits.run(settings); });
    const TrialSettings found =
        choose_penalty({fit.penalty, fit.density_variation, field.rank, shorter.epochs}, trials);
    return TunedFit{found, trials.made(), fits.predicted_views()};
  };
  std::optional<TunedFit> tuned = search_on_root(processes, search);
  if (!tuned) return std::nullopt;
  log_trials(tuned->trials);
  tuned->settings.epochs = fit.epochs;
  return tuned;
}

}  // namespace tomofield::reconstruction
