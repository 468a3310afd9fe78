#pragma once

#include <span>
#include <vector>

#include "measurement/view_residuals.h"

namespace tomofield::measurement {

/// Fits the noise of views by their residuals in an epoch. Both parts work on the residuals s² of a
/// view: their mean square, in which none is larger than its limit.
///
/// Weights: let q be s² in units of the noise σ² that was measured on the view. A view whose q is
/// above 1.75 times that of the median view shows what no volume explains: wrong tilts, motion, a
/// steep path through material that is not in the volume. Its weight 1 / σ² falls with the square
/// of q, down to a tenth. No weight rises above those of others, because a small residual may also
/// come from a fit that follows the view. Then all weights get one factor that restores their mean
/// over the rays, so that priors keep their strength.
///
/// Limits: no residual counts as larger than 4 σ, because what lies beyond is no noise: X-rays, hot
/// pixels, remnants of beads. Where s is above σ, the field does not explain the structure of the
/// view, whose largest residuals tell most. The limit then rises to 4 s² / σ.
///
/// `noise_weight` has 1 / σ² of all views of the series, `sums` and `models` are theirs, and
/// `fitted` are those to be fitted. Views without rays keep their models.
void fit_noise(std::span<const double> noise_weight, std::span<const int> fitted,
               std::span<const ViewSums> sums, std::span<ViewModel> models);

}  // namespace tomofield::measurement
