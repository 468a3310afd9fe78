#pragma once

#include <functional>
#include <vector>

namespace tomofield::selection {

/// How well a trial predicts the views held out.
struct HeldOutScore {
  double error = 0;                     ///< mean squared residual over the noise variance
  std::vector<double> view_error = {};  ///< the same of each view held out
};

/// Whether a predicts more than half of the views held out better than b. Unlike the mean
/// error, this cannot be decided by one view at the end of the tilts, which all predict badly.
bool most_views_prefer(const HeldOutScore& a, const HeldOutScore& b);

/// Standard error of the mean difference of two trials over the views held out:
/// the views' own noise is common to both and drops out.
double standard_error_of_difference(const HeldOutScore& a, const HeldOutScore& b);

/// The first of these trials, in order of preference, that the best one does not beat by more than
/// the standard error of their difference: what held-out views cannot tell apart. Index.
std::size_t first_as_good_as_the_best(const std::vector<HeldOutScore>& scores);

/// The score of a weight; asked for the same weight again it must give the same.
using ScoreOfWeight = std::function<HeldOutScore(double weight)>;

/// Weights that search_weight() tries where the best is near the first.
constexpr int kUsualWeights = 7;

/// The weight of a regulariser that predicts held-out views best: by a 1-D search on a
/// logarithmic scale, factors of 4 (to 256), then 2, then √2 about the best. Of the weights tried
/// that cannot be told from the best the largest (the smoothest volume) is taken: where held-out
/// views cannot tell, less noise is the better guess.
double search_weight(double first, const ScoreOfWeight& score);

}  // namespace tomofield::selection
