#pragma once

#include <span>

namespace tomofield::tune {

/// How much worse than the best one a trial at some place of a search predicts.
struct LossAt {
  double place = 0;           ///< such as the logarithm of a weight, in steps of the search
  double loss = 0;            ///< logarithm of the ratio of the errors (Difference)
  double standard_error = 0;  ///< of `loss`
};

/// The curvature that losses usually have: they grow by `loss_a_step` one step away from the
/// lowest, and `deviation` says how far that varies from one series to another.
struct UsualCurvature {
  double loss_a_step = 0;
  double deviation = 0;
};

/// Returns the place where a parabola through all of the losses is lowest, within the places that
/// were tried. Each loss counts by its standard error, and less the larger it is: far from its
/// lowest place, it is no parabola. The usual curvature counts as one more measurement. So chance
/// in a few losses moves the place less than it moves that of a parabola through three of them
/// (docs/results/choice.md). There is at least one loss.
double lowest_loss(std::span<const LossAt> losses, const UsualCurvature& usual);

}  // namespace tomofield::tune
