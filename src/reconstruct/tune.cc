#include "reconstruct/tune.h"

#include <algorithm>
#include <cmath>

namespace tomofield::reconstruct {
namespace {

constexpr int kMostSteps = 4;  // of the coarse search to one side: a factor of 256

class Search {
 public:
  Search(const TrialSettings& start, const RunTrial& run, std::vector<Trial>& trials)
      : best_(start), run_(run), trials_(trials) {}

  const TrialSettings& best() const { return best_; }

  void choose_penalty() {
    best_ = reconstruct::choose_penalty(best_, [this](const TrialSettings& s) { return trial(s); });
  }

  // Coarse steps until the best weight has a worse one on either side; then finer ones.
  void choose_variation() {
    const auto error_of = [&](double factor) {
      return error_with_variation(best_.variation * factor);
    };
    for (const double factor : {4.0, 0.25}) {
      for (int step = 0; step < kMostSteps && error_of(factor) < error_of(1); ++step)
        best_.variation *= factor;
    }
    for (const double factor : {2.0, std::sqrt(2.0)}) {
      const double below = error_of(1 / factor), here = error_of(1), above = error_of(factor);
      if (std::min(below, above) >= here) continue;
      best_.variation *= above < below ? factor : 1 / factor;
    }
    best_.variation = smoothest_of_the_best();
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
  double error_with_variation(double variation) {
    TrialSettings settings = best_;
    settings.variation = variation;
    return trial(settings).error;
  }

  // The largest weight tried whose error the best one does not beat by more than its
  // standard error: where held-out views cannot tell, less noise is the better guess.
  double smoothest_of_the_best() const {
    const Trial& best = *std::ranges::min_element(trials_, {}, &Trial::error);
    double largest = best.settings.variation;
    for (const Trial& t : trials_) {
      if (t.settings.penalty == best_.penalty &&
          t.error - best.error <= standard_error_of_difference(t, best))
        largest = std::max(largest, t.settings.variation);
    }
    return largest;
  }

  // The first, in order of cost, that the best does not beat by more than its standard error.
  void choose_cheapest(const std::vector<TrialSettings>& by_cost) {
    std::vector<Trial> tried;
    for (const TrialSettings& settings : by_cost) tried.push_back(trial(settings));
    const Trial& best = *std::ranges::min_element(tried, {}, &Trial::error);
    best_ = std::ranges::find_if(tried, [&](const Trial& t) {
              return t.error - best.error <= standard_error_of_difference(t, best);
            })->settings;
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

bool most_views_prefer(const Trial& a, const Trial& b) {
  const std::size_t n = std::min(a.view_error.size(), b.view_error.size());
  std::size_t prefer_a = 0;
  for (std::size_t v = 0; v < n; ++v) prefer_a += a.view_error[v] < b.view_error[v] ? 1 : 0;
  return 2 * prefer_a > n;
}

double standard_error_of_difference(const Trial& a, const Trial& b) {
  const std::size_t n = std::min(a.view_error.size(), b.view_error.size());
  if (n < 2) return 0;
  double sum = 0, squares = 0;
  for (std::size_t v = 0; v < n; ++v) {
    const double difference = a.view_error[v] - b.view_error[v];
    sum += difference;
    squares += difference * difference;
  }
  const double count = static_cast<double>(n);
  const double variance = std::max(squares - sum * sum / count, 0.0) / (count - 1);
  return std::sqrt(variance / count);
}

TrialSettings choose_penalty(const TrialSettings& start, const RunTrial& run) {
  TrialSettings concave = start, smooth = start;
  concave.penalty = "concave";
  smooth.penalty = "smooth";
  for (TrialSettings* settings : {&concave, &smooth})
    settings->variation = usual_variation(settings->penalty);
  const Trial with_concave = run(concave), with_smooth = run(smooth);
  return most_views_prefer(with_smooth, with_concave) ? smooth : concave;
}

int expected_trials(const SearchSpace& space) {
  return 7 + 2 + (space.penalty ? 1 : 0) + (space.rank ? 2 : 0);
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

}  // namespace tomofield::reconstruct
