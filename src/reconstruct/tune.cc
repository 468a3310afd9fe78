#include "reconstruct/tune.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tomofield::reconstruct {
namespace {

constexpr int kMostSteps = 4;  // of the coarse search to one side: a factor of 256
constexpr std::array kRanks = {8, 16, 24};

class Search {
 public:
  Search(const TrialSettings& start, const RunTrial& run, std::vector<Trial>& trials)
      : best_(start), run_(run), trials_(trials) {}

  const TrialSettings& best() const { return best_; }

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
    for (const int rank : kRanks) candidates.push_back({best_.variation, rank, best_.epochs});
    choose_cheapest(candidates);
  }

  void choose_epochs() {
    const int epochs = best_.epochs;
    std::vector<TrialSettings> candidates;
    for (const int n : {std::max(epochs / 2, 1), epochs, 2 * epochs})
      candidates.push_back({best_.variation, best_.rank, n});
    choose_cheapest(candidates);
  }

 private:
  double error_with_variation(double variation) {
    return trial({variation, best_.rank, best_.epochs}).error;
  }

  // The largest weight tried whose error the best one does not beat by more than its
  // standard error: where held-out views cannot tell, less noise is the better guess.
  double smoothest_of_the_best() const {
    const Trial& best = *std::ranges::min_element(trials_, {}, &Trial::error);
    double largest = best.settings.variation;
    for (const Trial& t : trials_) {
      if (t.error - best.error <= standard_error_of_difference(t, best))
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
      return t.settings.rank == settings.rank && t.settings.epochs == settings.epochs &&
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

int expected_trials(bool tunes_rank) { return 7 + 2 + (tunes_rank ? 2 : 0); }

TrialSettings search_settings(const TrialSettings& start, bool tunes_rank, const RunTrial& run,
                              std::vector<Trial>& trials) {
  Search search(start, run, trials);
  search.choose_variation();
  if (tunes_rank) search.choose_rank();
  search.choose_epochs();
  return search.best();
}

}  // namespace tomofield::reconstruct
