#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace tomofield::tune {

/// The errors with which a trial predicts the held-out views, and how clean its volume is.
struct HeldOutScore {
  double error = 0;                      ///< mean squared residual over the noise variance
  std::vector<double> view_error = {};   ///< the same of each held-out view
  std::vector<double> patch_error = {};  ///< the same of each patch of these views; may be empty
  std::optional<double> speckle = {};    ///< evaluate/speckle.h; none if it was not measured
  std::optional<double> face_jump = {};  ///< evaluate/face_jump.h; none if no face is in the volume
};

/// Returns true if `a` predicts more than half of the held-out views better than `b`. One view at
/// the end of the tilt range, which every trial predicts badly, can decide the mean error, but not
/// this.
bool most_views_prefer(const HeldOutScore& a, const HeldOutScore& b);

/// The difference between the errors with which two trials predict the held-out views.
struct Difference {
  double log_ratio = 0;       ///< of the errors; 0.01 is about one per cent
  double standard_error = 0;  ///< of `log_ratio`
  bool is_beyond(double num_errors) const { return log_ratio > num_errors * standard_error; }
};
/// Compares `a` with `b` patch by patch of the held-out views, or view by view if they have no
/// patches. The noise of the views themselves is the same in both trials and cancels. `log_ratio`
/// is the estimate of Hodges and Lehmann (Ann. Math. Stat. 34, 598, 1963), the median of all means
/// of two patches; the standard error is from the median absolute deviation. So a place or a view
/// that every trial predicts badly, such as one at the end of the tilt range, does not decide.
Difference difference(const HeldOutScore& a, const HeldOutScore& b);

/// Compares the mean errors of all patches, or views. A structure that fills a few patches counts
/// here, while nearly empty ones decide difference(). A patch that both trials predict badly adds
/// to the standard error, which is that of a ratio of means (Cochran, Sampling Techniques,
/// 1977, 6.4).
Difference difference_of_means(const HeldOutScore& a, const HeldOutScore& b);

/// Returns the indices of the trials that the best one does not beat by more than `num_errors`
/// standard errors of their difference, ascending. Held-out views cannot tell them from the best.
std::vector<std::size_t> as_good_as_the_best(const std::vector<HeldOutScore>& scores,
                                             double num_errors = 1);

/// Returns the score of a weight, and always the same one for the same weight.
using ScoreOfWeight = std::function<HeldOutScore(double weight)>;
/// Is told the weights whose scores are needed next, so that they can be computed together.
using ExpectWeights = std::function<void(const std::vector<double>& weights)>;

/// Number of weights that search_weight() tries if the best one is near the first.
constexpr int kUsualWeights = 7;

/// Returns the weight of a regulariser that predicts held-out views best. It searches on a
/// logarithmic scale: in factors of 4 (up to 256) from `first`, then 2 and √2 about the best. Of
/// all tried weights that are as good as the best (as_good_as_the_best()), it takes the
/// largest. That one makes the smoothest volume: where held-out views cannot tell, less noise is
/// the better guess.
double search_weight(double first, const ScoreOfWeight& score, const ExpectWeights& expect = {});

}  // namespace tomofield::tune
