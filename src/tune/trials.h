#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "tune/scores.h"

namespace tomofield::tune {

/// A plane of the volume that a trial made, to look at: [row][x].
struct Section {
  std::int64_t width = 0;
  std::vector<float> values = {};
};

/// A short fit with some settings, and how well it predicts the held-out views. `Settings` is
/// whatever a method lets a search choose.
template <typename Settings>
struct Trial {
  Settings settings = {};
  HeldOutScore score = {};
  double seconds = 0;
  /// Relative decrease of the objective in the last tenth of an iterative method.
  std::optional<double> last_decrease = {};
  Section section = {};  ///< is empty if none was kept
};

/// The chosen settings and all trials of a search.
template <typename Settings>
struct Tuned {
  Settings settings = {};
  std::vector<Trial<Settings>> trials;  ///< in the order in which they were made
  std::vector<int> predicted_views;     ///< held-out views that the choice rests on
  /// Trials of another shape than `trials`, made with the chosen settings. They compare with each
  /// other alone.
  std::vector<Trial<Settings>> last_trials = {};
};

/// Makes the trials of a search, none of them twice, and applies the rules by which settings are
/// chosen. It knows no method: the caller hands it "run these trials" and "are these settings
/// equal".
template <typename Settings>
class Trials {
 public:
  /// Makes a trial with each of these settings, which all differ, and returns them in this order.
  /// The trials do not depend on each other, so they may be made at the same time. The same
  /// settings always give the same score.
  using RunTrials = std::function<std::vector<Trial<Settings>>(const std::vector<Settings>&)>;
  using RunTrial = std::function<Trial<Settings>(const Settings&)>;
  using AreEqual = std::function<bool(const Settings&, const Settings&)>;

  Trials(RunTrials run, AreEqual are_equal)
      : run_(std::move(run)), are_equal_(std::move(are_equal)) {}
  /// Makes one trial after another.
  Trials(RunTrial run, AreEqual are_equal)
      : Trials(RunTrials([run = std::move(run)](const std::vector<Settings>& all) {
                 std::vector<Trial<Settings>> trials;
                 for (const Settings& settings : all) trials.push_back(run(settings));
                 return trials;
               }),
               std::move(are_equal)) {}

  /// Makes those of these trials that there are not yet, all of them together.
  void make(const std::vector<Settings>& wanted) {
    std::vector<Settings> missing;
    for (const Settings& settings : wanted) {
      const auto is_equal = [&](const Settings& s) { return are_equal_(s, settings); };
      if (!find(settings) && std::ranges::none_of(missing, is_equal)) missing.push_back(settings);
    }
    if (missing.empty()) return;
    for (Trial<Settings>& trial : run_(missing)) made_.push_back(std::move(trial));
  }

  /// Returns the trial with these settings and makes it if there is none yet.
  Trial<Settings> trial(const Settings& settings) {
    make({settings});
    return *find(settings);
  }

  /// Returns `other` if most held-out views prefer it, else `usual`.
  Settings preferred_by_most_views(const Settings& usual, const Settings& other) {
    make({usual, other});
    const HeldOutScore of_usual = trial(usual).score, of_other = trial(other).score;
    return most_views_prefer(of_other, of_usual) ? other : usual;
  }

  /// Returns those of these candidates that the best one does not beat by more than `num_errors`
  /// standard errors of their difference, in their order.
  std::vector<Settings> as_good(const std::vector<Settings>& candidates, double num_errors = 1) {
    make(candidates);
    std::vector<HeldOutScore> scores;
    for (const Settings& settings : candidates) scores.push_back(trial(settings).score);
    std::vector<Settings> good;
    for (const std::size_t i : as_good_as_the_best(scores, num_errors))
      good.push_back(candidates[i]);
    return good;
  }

  /// Returns the first of these candidates, in order of preference, that is as good as the best.
  Settings first_as_good(const std::vector<Settings>& candidates, double num_errors = 1) {
    return as_good(candidates, num_errors).front();
  }

  /// Returns `settings` with the weight that search_weight() finds. set_weight(settings, weight)
  /// changes the weight alone.
  template <typename SetWeight>
  Settings with_best_weight(Settings settings, double first, const SetWeight& set_weight) {
    const auto with = [&](double weight) {
      Settings tried = settings;
      set_weight(tried, weight);
      return tried;
    };
    const double best = search_weight(
        first, [&](double weight) { return trial(with(weight)).score; },
        [&](const std::vector<double>& weights) {
          std::vector<Settings> candidates;
          for (const double weight : weights) candidates.push_back(with(weight));
          make(candidates);
        });
    set_weight(settings, best);
    return settings;
  }

  /// Adds a trial that was made elsewhere, such as one of several from one run.
  void add(Trial<Settings> trial) { made_.push_back(std::move(trial)); }

  const std::vector<Trial<Settings>>& made() const { return made_; }

 private:
  const Trial<Settings>* find(const Settings& settings) const {
    const auto known = std::ranges::find_if(
        made_, [&](const Trial<Settings>& t) { return are_equal_(t.settings, settings); });
    return known == made_.end() ? nullptr : &*known;
  }

  RunTrials run_;
  AreEqual are_equal_;
  std::vector<Trial<Settings>> made_;
};

}  // namespace tomofield::tune
