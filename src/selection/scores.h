#pragma once

#include <functional>
#include <vector>

namespace tomofield::selection {

/// Says how well a trial predicts the held-out views.
struct HeldOutScore {
  double error = 0;                     ///< mean squared residual over the noise variance
  std::vector<double> view_error = {};  ///< the same of each held-out view
};

/// Says whether `a` predicts more than half of the held-out views better than `b`. One view at the
/// end of the tilt range, which every trial predicts badly, can decide the mean error, but not
/// this.
bool most_views_prefer(const HeldOutScore& a, const HeldOutScore& b);

/// Returns the standard error of the mean difference of two trials over the held-out views. The
/// noise of the views themselves is the same in both trials and cancels.
double standard_error_of_difference(const HeldOutScore& a, const HeldOutScore& b);

/// Returns the index of the first trial that the best one does not beat by more than the standard
/// error of their difference. `scores` are in order of preference. Held-out views cannot tell such
/// a trial from the best one.
std::size_t first_as_good_as_the_best(const std::vector<HeldOutScore>& scores);

/// Returns the score of a weight, and always the same one for the same weight.
using ScoreOfWeight = std::function<HeldOutScore(double weight)>;
/// Is told the weights whose scores are needed next, so that they can be computed together.
using ExpectWeights = std::function<void(const std::vector<double>& weights)>;

/// Number of weights that search_weight() tries if the best one is near the first.
constexpr int kUsualWeights = 7;

/// Returns the weight of a regulariser that predicts held-out views best. It searches on a
/// logarithmic scale: in factors of 4 (up to 256) from `first`, then 2 and √2 about the best. Of
/// all tried weights that are as good as the best (first_as_good_as_the_best()), it takes the
/// largest. That one makes the smoothest volume: where held-out views cannot tell, less noise is
/// the better guess.
double search_weight(double first, const ScoreOfWeight& score, const ExpectWeights& expect = {});

}  // namespace tomofield::selection
