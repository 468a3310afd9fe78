#include "baseline/tune.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "base/log.h"
#include "base/progress.h"
#include "base/trace.h"
#include "baseline/baseline_record.h"
#include "baseline/voxel_problem.h"
#include "tune/scores.h"
#include "tune/trial_measurement.h"

namespace tomofield::baseline {
namespace {

using Trials = tune::Trials<Method>;

constexpr int kLadderSteps = 4;  // factors of √2 up and down from the first number of iterations
constexpr int kCutoffs = 7;      // candidates, each √2 times the one before

// The largest fall of the objective in the last tenth of the iterations at which a trial of `tv`
// counts as converged. Before that, a held-out error says how near the trial is to its minimum
// rather than how good the weight is: after 10 iterations on a phantom a tenth of the best weight
// seemed better.
constexpr double kAtMinimum = 0.01;
constexpr int kMaxTrialIterations = 400;  // upper limit for trials that have not converged

// Makes the runs of the trials and reports their progress.
class TrialRuns {
 public:
  TrialRuns(const TrialData& data, const base::ProgressSink& progress)
      : data_(data),
        progress_(progress),
        views_(tune::trial_views(data.measurement.geometry.tilt_deg, data.scored)),
        measurement_(tune::trial_measurement(data.measurement, views_, tune::kTrialRows)) {}

  // Runs a method to its end.
  Trial whole_run(const Method& method) {
    std::vector<Trial> trials;
    const std::optional<double> fell = run(method, trials, [&](int iteration) {
      return iteration == facts_of(method).iterations ? std::optional(method) : std::nullopt;
    });
    trials.back().last_decrease = fell;
    return trials.back();
  }

  // Makes one run and returns a trial for each of these numbers of iterations, which ascend.
  template <StopsEarly Options>
  std::vector<Trial> stopped_runs(Options options, const std::vector<int>& iterations) {
    options.iterations = iterations.back();
    std::vector<Trial> trials;
    run(options, trials, [&, stopped = options](int iteration) mutable {
      stopped.iterations = iteration;
      return std::ranges::binary_search(iterations, iteration) ? std::optional<Method>(stopped)
                                                               : std::nullopt;
    });
    return trials;
  }

  // Tells the progress what will come: about `runs` more runs, with `iterations` in all.
  void expect(int runs, int iterations) {
    expected_runs_ = num_runs_ + runs;
    expected_iterations_ = iterations_done_ + iterations;
  }

  const std::vector<int>& predicted_views() const { return views_.predicted; }

 private:
  // Adds a trial after each iteration for which trial_after() returns the trial's method. Returns
  // the fall of the objective at the end.
  template <typename TrialAfter>
  std::optional<double> run(const Method& method, std::vector<Trial>& trials,
                            TrialAfter trial_after) {
    VoxelProblem problem(measurement_.geometry, data_.grid, *measurement_.rays,
                         measurement_.noise_sigma, {measurement_.held_out, data_.fit_view_scale});
    const base::Stopwatch running;
    const AfterIteration after_iteration = [&](const IterationReport& report,
                                               VoxelVolume& densities) {
      report_progress(method, report.iteration);
      const std::optional<Method> tried = trial_after(report.iteration);
      if (!tried) return;
      const measurement::ViewErrors errors =
          held_out_errors(problem, measurement_.held_out, data_.fit_view_scale, densities);
      trials.push_back({*tried, {errors.total, errors.view_error}, running.seconds(), {}});
      base::log_info(
          fmt::format("tried{}: held-out error {:.5f}", settings_text(*tried), errors.total));
    };
    const Solution solution =
        reconstruct(problem, method, measurement_.mean_density, after_iteration);
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
  tune::TrialViews views_;
  measurement::Measurement measurement_;
  base::Stopwatch running_;
  int num_runs_ = 0, expected_runs_ = 0;
  int iterations_done_ = 0, expected_iterations_ = 0;
};

bool votes_on_penalty(const TvOptions& options) { return !options.penalty && !options.weight; }

TvOptions with_better_penalty(const TvOptions& options, Trials& trials) {
  if (!votes_on_penalty(options)) return options;
  TvOptions concave = options, smooth = options;
  concave.penalty = Penalty::kConcave;
  smooth.penalty = Penalty::kSmooth;
  return std::get<TvOptions>(trials.preferred_by_most_views(concave, smooth));
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
  options = std::get<Options>(trials.with_best_weight(
      options, first_weight(options),
      [](Method& method, double weight) { std::get<Options>(method).weight = weight; }));
}

int on_ladder(int first, int step) {
  return static_cast<int>(std::lround(first * std::exp2(0.5 * step)));
}

template <StopsEarly Options>
void choose_iterations(Options& options, TrialRuns& runs, Trials& trials) {
  std::vector<int> ladder;
  for (int step = -kLadderSteps; step <= kLadderSteps; ++step) {
    const int iterations = on_ladder(options.iterations, step);
    if (iterations > (ladder.empty() ? 0 : ladder.back())) ladder.push_back(iterations);
  }
  std::vector<Method> candidates;
  for (Trial& trial : runs.stopped_runs(options, ladder)) {
    candidates.push_back(trial.settings);
    trials.add(std::move(trial));
  }
  options = std::get<Options>(trials.first_as_good(candidates));
}

template <HasCutoff Options>
void choose_cutoff(Options& options, Trials& trials) {
  std::vector<Method> candidates;
  for (int step = 1; step <= kCutoffs; ++step) {
    Options other = options;
    other.filter.cutoff *= std::exp2(0.5 * (step - kCutoffs));
    candidates.push_back(other);
  }
  options = std::get<Options>(trials.first_as_good(candidates));
}

// Repeats the search with more iterations until the chosen trial is at its minimum.
Method tuned(const TvOptions& start, TrialRuns& runs, Trials& trials) {
  for (TvOptions tried = start;;) {
    const int expected = tune::kUsualWeights + (votes_on_penalty(tried) ? 1 : 0);
    runs.expect(expected, expected * tried.iterations);
    TvOptions chosen = with_better_penalty(tried, trials);
    choose_weight(chosen, trials);
    const double fell = trials.trial(chosen).last_decrease.value_or(0);
    if (fell <= kAtMinimum || tried.iterations >= kMaxTrialIterations) {
      chosen.iterations = start.iterations;
      return chosen;
    }
    base::log_info(fmt::format(
        "{} iterations are too few for trials: the objective still falls by {:.2g} % in the last "
        "tenth",
        tried.iterations, 100 * fell));
    tried.iterations = std::min(4 * tried.iterations, kMaxTrialIterations);
    if (start.weight) tried.weight = chosen.weight;
  }
}

template <typename Options>
void expect_runs(const Options& options, TrialRuns& runs) {
  constexpr int kWeights = HasWeight<Options> ? tune::kUsualWeights : 0;
  if constexpr (StopsEarly<Options>) {
    runs.expect(kWeights + 1,
                kWeights * options.iterations + on_ladder(options.iterations, kLadderSteps));
  }
  if constexpr (HasCutoff<Options>) runs.expect(kCutoffs, kCutoffs);
}

template <typename Options>
Method tuned(Options options, TrialRuns& runs, Trials& trials) {
  expect_runs(options, runs);
  if constexpr (HasWeight<Options>) choose_weight(options, trials);
  if constexpr (StopsEarly<Options>) choose_iterations(options, runs, trials);
  if constexpr (HasCutoff<Options>) choose_cutoff(options, trials);
  return options;
}

}  // namespace

bool is_tunable(const Method& method) {
  return std::visit([]<typename M>(const M&) { return Tunable<M>; }, method);
}

Tuned tune(const Method& start, const TrialData& data, const base::ProgressSink& progress) {
  const base::TraceSpan span("trials");
  TrialRuns runs(data, progress);
  Trials trials([&](const Method& method) { return runs.whole_run(method); },
                [](const Method& a, const Method& b) { return json_of(a) == json_of(b); });
  const Method method =
      std::visit([&](const auto& options) { return tuned(options, runs, trials); }, start);
  base::log_info(fmt::format("tuned:{}", settings_text(method)));
  return {method, trials.made(), runs.predicted_views()};
}

}  // namespace tomofield::baseline
