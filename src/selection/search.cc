#include "selection/search.h"

#include <algorithm>
#include <cmath>

namespace tomofield::selection {
namespace {

class Search {
 public:
  Search(const TrialSettings& start, const RunTrial& run, std::vector<Trial>& trials)
      : best_(start), run_(run), trials_(trials) {}

  const TrialSettings& best() const { return best_; }

  void choose_penalty() {
    best_ = selection::choose_penalty(best_, [this](const TrialSettings& s) { return trial(s); });
  }

  void choose_variation() {
    best_.variation = search_weight(best_.variation, [this](double weight) {
      TrialSettings settings = best_;
      settings.variation = weight;
      return trial(settings).score;
    });
  }

  void choose_rank() {
    std::vector<TrialSettings> candidates;
    for (const int thirds : {1, 2, 3}) {
      candidates.push_back(best_);
      candidates.back().rank = std::max(thirds * best_.rank / 3, 1);
    }
    choose_cheapest(candidates);
  }

  void choose_epochs() {
    std::vector<TrialSettings> candidates;
    for (const int epochs : {std::max(best_.epochs / 2, 1), best_.epochs, 2 * best_.epochs}) {
      candidates.push_back(best_);
      candidates.back().epochs = epochs;
    }
    choose_cheapest(candidates);
  }

 private:
  // By cost.
  void choose_cheapest(const std::vector<TrialSettings>& candidates) {
    std::vector<HeldOutScore> scores;
    for (const TrialSettings& settings : candidates) scores.push_back(trial(settings).score);
    best_ = candidates[first_as_good_as_the_best(scores)];
  }

  Trial trial(const TrialSettings& settings) {
    const auto same = [&](const Trial& t) {
      return t.settings.penalty == settings.penalty && t.settings.rank == settings.rank &&
             t.settings.epochs == settings.epochs &&
             std::abs(t.settings.variation / settings.variation - 1) < 1e-9;
    };
    const auto known = std::ranges::find_if(trials_, same);
    if (known != trials_.end()) return *known;
    trials_.push_back(run_(settings));
    return trials_.back();
  }

  TrialSettings best_;
  const RunTrial& run_;
  std::vector<Trial>& trials_;
};

}  // namespace

TrialSettings choose_penalty(const TrialSettings& start, const RunTrial& run) {
  TrialSettings concave = start, smooth = start;
  concave.penalty = Penalty::kConcave;
  smooth.penalty = Penalty::kSmooth;
  for (TrialSettings* settings : {&concave, &smooth})
    settings->variation = objective::usual_variation(settings->penalty);
  const Trial with_concave = run(concave), with_smooth = run(smooth);
  return most_views_prefer(with_smooth.score, with_concave.score) ? smooth : concave;
}

int expected_trials(const SearchSpace& space) {
  return kUsualWeights + 2 + (space.penalty ? 1 : 0) + (space.rank ? 2 : 0);
}

TrialSettings search_settings(const TrialSettings& start, const SearchSpace& space,
                              const RunTrial& run, std::vector<Trial>& trials) {
  Search search(start, run, trials);
  if (space.penalty) search.choose_penalty();
  search.choose_variation();
  if (space.rank) search.choose_rank();
  search.choose_epochs();
  return search.best();
}

}  // namespace tomofield::selection
