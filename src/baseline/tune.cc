#include "baseline/tune.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/stopwatch.h"
#include "baseline/held_out.h"
#include "selection/trial_series.h"
#include "selection/scores.h"

namespace tomofield::baseline {
namespace {

using selection::HeldOutScore;

constexpr int kLadderSteps = 4;  // factors of √2 up and down from the first number of iterations
constexpr int kCutoffs = 7;      // candidates, each √2 times the one before

// The largest fall of the objective in the last tenth of the iterations at which a trial of `tv`
// counts as converged. Before that, a held-out error says how near the trial is to its minimum
// rather than how good the weight is: after 10 iterations on a phantom a tenth of the best weight
// seemed better.
constexpr double kAtMinimum = 0.01;
constexpr int kMaxIterations = 400;  // upper limit for trials that have not converged

// Returns the settings that a tuning may change, as the command line writes them.
std::string settings_text(const Method& method) {
  const nlohmann::json json = json_of(method);
  std::string text;
  for (const char* key : {"penalty", "weight", "iterations", "cutoff"}) {
    if (!json.contains(key)) continue;
    const nlohmann::json& value = json[key];
    text += fmt::format(
        " --{} {}", key,
        value.is_string() ? value.get<std::string>() : fmt::format("{:.4g}", value.get<double>()));
  }
  return text;
}

// Makes the trials of a search and reports its progress. It makes no trial twice.
class Trials {
 public:
  Trials(const TrialData& data, const base::ProgressSink& progress)
      : data_(data),
        progress_(progress),
        series_(selection::make_trial_series(data.series.geometry, data.series.noise_sigma,
                                             *data.series.rays, data.scored,
                                             selection::kTrialRows)) {}

  const Trial& trial(const Method& method) {
    const nlohmann::json settings = json_of(method);
    const auto known = std::ranges::find_if(
        trials_, [&](const Trial& t) { return json_of(t.method) == settings; });
    if (known != trials_.end()) return *known;
    const std::optional<double> fell = run(method, [&](int iteration) {
      return iteration == facts_of(method).iterations ? std::optional(method) : std::nullopt;
    });
    trials_.back().last_decrease = fell;
    return trials_.back();
  }

  // Makes one run and scores it after each of these numbers of iterations, which ascend.
  template <StopsEarly Options>
  std::vector<HeldOutScore> scores(Options options, const std::vector<int>& iterations) {
    options.iterations = iterations.back();
    const std::size_t first = trials_.size();
    run(options, [&, stopped = options](int iteration) mutable {
      stopped.iterations = iteration;
      return std::ranges::binary_search(iterations, iteration) ? std::optional<Method>(stopped)
                                                               : std::nullopt;
    });
    std::vector<HeldOutScore> scores;
    for (std::size_t i = first; i < trials_.size(); ++i) scores.push_back(trials_[i].score);
    return scores;
  }

  // Tells the progress what will come: about `runs` more runs, with `iterations` in all.
  void expect(int runs, int iterations) {
    expected_runs_ = num_runs_ + runs;
    expected_iterations_ = iterations_done_ + iterations;
  }

  Tuned take(const Method& chosen) {
    return {chosen, std::move(trials_), std::move(series_.views.predicted)};
  }

 private:
  // Adds a trial after each iteration for which trial_after() returns the trial's method. Returns
  // the fall of the objective at the end.
  template <typename TrialAfter>
  std::optional<double> run(const Method& method, TrialAfter trial_after) {
    VoxelProblem problem(series_.geometry, data_.grid, *series_.rays, series_.noise_sigma,
                         {series_.held_out, data_.fit_view_scale});
    const base::Stopwatch running;
    const AfterIteration after_iteration = [&](const IterationReport& report,
                                               VoxelVolume& densities) {
      report_progress(method, report.iteration);
      const std::optional<Method> tried = trial_after(report.iteration);
      if (!tried) return;
      const measurement::ViewErrors errors =
          held_out_errors(problem, series_.held_out, data_.fit_view_scale, densities);
      trials_.push_back({*tried, {errors.total, errors.view_error}, running.seconds(), {}});
      base::log_info(
          fmt::format("tried{}: held-out error {:.5f}", settings_text(*tried), errors.total));
    };
    const Solution solution =
        reconstruct(problem, method, data_.series.mean_density, after_iteration);
    ++num_runs_;
    iterations_done_ += facts_of(method).iterations;
    return last_decrease(solution);
  }

  void report_progress(const Method& method, int iteration) const {
    if (!progress_) return;
    const int run = num_runs_ + 1;
    const int iterations =
        std::max(expected_iterations_, iterations_done_ + facts_of(method).iterations);
    progress_(base::progress_at(
        static_cast<double>(iterations_done_ + iteration) / iterations, running_.seconds(),
        fmt::format("trial {}/{} {}", run, std::max(expected_runs_, run), settings_text(method))));
  }

  const TrialData& data_;
  const base::ProgressSink& progress_;
  selection::TrialSeries series_;
  base::Stopwatch running_;
  std::vector<Trial> trials_;
  int num_runs_ = 0, expected_runs_ = 0;
  int iterations_done_ = 0, expected_iterations_ = 0;
};

bool votes_on_penalty(const TvOptions& options) { return !options.penalty && !options.weight; }

TvOptions with_better_penalty(const TvOptions& options, Trials& trials) {
  if (!votes_on_penalty(options)) return options;
  TvOptions concave = options, smooth = options;
  concave.penalty = Penalty::kConcave;
  smooth.penalty = Penalty::kSmooth;
  const HeldOutScore with_concave = trials.trial(concave).score,
                     with_smooth = trials.trial(smooth).score;
  return selection::most_views_prefer(with_smooth, with_concave) ? smooth : concave;
}

double first_weight(const TvOptions& options) {
  return options.weight.value_or(options.usual_weight());
}
template <HasWeight Options>
double first_weight(const Options& options) {
  return options.weight;
}

template <HasWeight Options>
void choose_weight(Options& options, Trials& trials) {
  options.weight = selection::search_weight(first_weight(options), [&](double weight) {
    Options other = options;
    other.weight = weight;
    return trials.trial(other).score;
  });
}

int on_ladder(int first, int step) {
  return static_cast<int>(std::lround(first * std::exp2(0.5 * step)));
}

template <StopsEarly Options>
void choose_iterations(Options& options, Trials& trials) {
  std::vector<int> ladder;
  for (int step = -kLadderSteps; step <= kLadderSteps; ++step) {
    const int iterations = on_ladder(options.iterations, step);
    if (iterations > (ladder.empty() ? 0 : ladder.back())) ladder.push_back(iterations);
  }
  options.iterations = ladder[selection::first_as_good_as_the_best(trials.scores(options, ladder))];
}

template <HasCutoff Options>
void choose_cutoff(Options& options, Trials& trials) {
  std::vector<double> cutoffs;
  std::vector<HeldOutScore> scores;
  for (int step = 1; step <= kCutoffs; ++step) {
    Options other = options;
    other.filter.cutoff *= std::exp2(0.5 * (step - kCutoffs));
    cutoffs.push_back(other.filter.cutoff);
    scores.push_back(trials.trial(other).score);
  }
  options.filter.cutoff = cutoffs[selection::first_as_good_as_the_best(scores)];
}

// Repeats the search with more iterations until the chosen trial is at its minimum.
Method tuned(const TvOptions& start, Trials& trials) {
  for (TvOptions tried = start;;) {
    const int runs = selection::kUsualWeights + (votes_on_penalty(tried) ? 1 : 0);
    trials.expect(runs, runs * tried.iterations);
    TvOptions chosen = with_better_penalty(tried, trials);
    choose_weight(chosen, trials);
    const double fell = trials.trial(chosen).last_decrease.value_or(0);
    if (fell <= kAtMinimum || tried.iterations >= kMaxIterations) {
      chosen.iterations = start.iterations;
      return chosen;
    }
    base::log_info(fmt::format(
        "{} iterations are too few for trials: the objective still falls by {:.2g} % in the last "
        "tenth",
        tried.iterations, 100 * fell));
    tried.iterations = std::min(4 * tried.iterations, kMaxIterations);
    if (start.weight) tried.weight = chosen.weight;
  }
}

template <typename Options>
void expect_runs(const Options& options, Trials& trials) {
  constexpr int kWeights = HasWeight<Options> ? selection::kUsualWeights : 0;
  if constexpr (StopsEarly<Options>) {
    trials.expect(kWeights + 1,
                  kWeights * options.iterations + on_ladder(options.iterations, kLadderSteps));
  }
  if constexpr (HasCutoff<Options>) trials.expect(kCutoffs, kCutoffs);
}

template <typename Options>
Method tuned(Options options, Trials& trials) {
  expect_runs(options, trials);
  if constexpr (HasWeight<Options>) choose_weight(options, trials);
  if constexpr (StopsEarly<Options>) choose_iterations(options, trials);
  if constexpr (HasCutoff<Options>) choose_cutoff(options, trials);
  return options;
}

}  // namespace

Tuned tune(const Method& start, const TrialData& data, const base::ProgressSink& progress) {
  Trials trials(data, progress);
  const Method method =
      std::visit([&](const auto& options) { return tuned(options, trials); }, start);
  base::log_info(fmt::format("tuned:{}", settings_text(method)));
  return trials.take(method);
}

nlohmann::json tuning_json(const Tuned& tuned) {
  nlohmann::json trials = nlohmann::json::array();
  for (const Trial& t : tuned.trials) {
    nlohmann::json entry = json_of(t.method);
    entry["held_out_error"] = t.score.error;
    entry["held_out_error_by_view"] = t.score.view_error;
    entry["seconds"] = t.seconds;
    trials.push_back(std::move(entry));
  }
  return {{"predicted_views", tuned.predicted_views},
          {"chosen", json_of(tuned.method)},
          {"trials", trials}};
}

}  // namespace tomofield::baseline
