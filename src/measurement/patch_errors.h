#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "measurement/held_out.h"

namespace tomofield::measurement {

/// Number of columns of a patch of patch_errors(). The residuals of patches so wide hardly depend
/// on each other, also where an interpolation has blurred the noise.
constexpr std::int64_t kPatchColumns = 32;

/// Returns the mean squared residual, over the variance of the noise, in each patch of
/// kPatchColumns columns and all rows of predicted views, view by view, from left to right.
/// `noise_weight` holds 1 / variance of the noise of each of these views. A patch in which fewer
/// than half of the pixels are measured has no error and is left out.
std::vector<double> patch_errors(std::span<const PredictedView> views,
                                 std::span<const double> noise_weight);

}  // namespace tomofield::measurement
