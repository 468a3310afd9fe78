#include "reconstruct/tuning.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

namespace tomofield::reconstruction {
namespace {

// Errors of an imagined series: best at some weight, and better by `gain` a doubling of
// the rank and of the epochs, up to what is needed. Views differ from each other, not
// between trials, but for `scatter`.
struct ImaginedSeries {
  double best_variation = 10;
  int needed_rank = 16, needed_epochs = 30;
  double gain = 0.1, scatter = 0;
  double smooth_error = 0.05;  // more of a smooth penalty at its own best weight
  int num_trials = 0;

  FitTrial run(const TrialSettings& s) {
    ++num_trials;
    const bool is_smooth = s.penalty == Penalty::kSmooth;
    const double best = is_smooth ? best_variation * objective::usual_variation(Penalty::kSmooth) /
                                        objective::usual_variation(Penalty::kConcave)
                                  : best_variation;
    const double doublings = std::log2(s.variation / best);
    double error = 1 + (is_smooth ? smooth_error : 0) + 0.02 * doublings * doublings;
    error += gain * std::max(0.0, std::log2(static_cast<double>(needed_rank) / s.rank));
    error += gain * std::max(0.0, std::log2(static_cast<double>(needed_epochs) / s.epochs));
    FitTrial trial{s, {error, {}}};
    for (int view = 0; view < 12; ++view) {
      const double sign = (view + num_trials) % 2 == 0 ? 1 : -1;
      trial.score.view_error.push_back(error + 0.3 * view + sign * scatter);
    }
    return trial;
  }
};

TrialSettings search(ImaginedSeries& series, std::vector<FitTrial>& trials,
                     const SearchSpace& space = {.penalty = false}) {
  FitTrials search_trials = make_trials([&](const TrialSettings& s) { return series.run(s); });
  const TrialSettings found = search_settings({Penalty::kConcave, 9, 24, 30}, space, search_trials);
  trials = search_trials.made();
  return found;
}

TEST(SearchSettings, FindsTheWeightWithinAFactorOfRootTwo) {
  for (const double best : {0.2, 3.0, 9.0, 13.0, 100.0, 800.0}) {
    ImaginedSeries series{.best_variation = best};
    std::vector<FitTrial> trials;
    const TrialSettings found = search(series, trials);
    EXPECT_LE(std::abs(std::log2(found.variation / best)), 0.5) << best << " " << found.variation;
    std::set<std::tuple<double, int, int>> distinct;
    for (const FitTrial& t : trials)
      distinct.insert({t.settings.variation, t.settings.rank, t.settings.epochs});
    EXPECT_EQ(distinct.size(), trials.size()) << "tried twice";
    EXPECT_EQ(static_cast<int>(trials.size()), series.num_trials);
  }
}

TEST(SearchSettings, PaysForRankAndEpochsOnlyWhatHelps) {
  ImaginedSeries modest{.best_variation = 9, .needed_rank = 8, .needed_epochs = 15};
  ImaginedSeries demanding{.best_variation = 9, .needed_rank = 24, .needed_epochs = 60};
  std::vector<FitTrial> trials;
  TrialSettings found = search(modest, trials);
  EXPECT_EQ(std::pair(found.rank, found.epochs), std::pair(8, 15));
  trials.clear();
  found = search(demanding, trials);
  EXPECT_EQ(std::pair(found.rank, found.epochs), std::pair(24, 60));
  trials.clear();
  EXPECT_EQ(search(modest, trials, {.penalty = false, .rank = false}).rank, 24);
}

TEST(SearchSettings, TakesThePenaltyThatPredictsBetterAndItsOwnWeight) {
  for (const double smooth_error : {0.05, -0.05}) {
    ImaginedSeries series{.best_variation = 28, .smooth_error = smooth_error};
    std::vector<FitTrial> trials;
    const TrialSettings found = search(series, trials, {});
    EXPECT_EQ(found.penalty, smooth_error > 0 ? Penalty::kConcave : Penalty::kSmooth);
    EXPECT_NEAR(found.variation, smooth_error > 0 ? 28 : 10, 1e-9);
    FitTrials two = make_trials([&](const TrialSettings& s) { return series.run(s); });
    EXPECT_EQ(choose_penalty({Penalty::kConcave, 3, 24, 30}, two).penalty, found.penalty);
    EXPECT_EQ(two.made().size(), 2u);
  }
}

TEST(SearchSettings, TakesTheSmoothestOfWhatCannotBeToldApart) {
  ImaginedSeries sure{.best_variation = 9}, unsure{.best_variation = 9, .scatter = 0.1};
  std::vector<FitTrial> trials, unsure_trials;
  EXPECT_NEAR(search(sure, trials).variation, 9, 1e-9);
  EXPECT_GT(search(unsure, unsure_trials).variation, 9 * 1.4);
}

}  // namespace
}  // namespace tomofield::reconstruction
