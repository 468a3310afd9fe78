#pragma once

#include <span>
#include <vector>

#include "measurement/view_residuals.h"

namespace tomofield::measurement {

/// How well something predicts views.
struct ViewErrors {
  std::vector<int> views;
  std::vector<ViewModel> models;   ///< of each of the views: what it was scored with
  std::vector<double> view_error;  ///< mean squared residual over the noise variance
  double total = 0;                ///< over all of their rays
};

/// [slab][view]
using SlabSums = std::vector<std::vector<ViewSums>>;

/// The errors of `views` from sums over their rays, added in order of the slabs;
/// `noise_weight` holds 1 / variance of the noise of each view of the series. With
/// `fit_view_scale`, a view's scale and offset are least squares on that view
/// alone: they are nuisances of its exposure, which no other view tells.
ViewErrors view_errors(std::vector<int> views, const SlabSums& sums,
                       std::span<const double> noise_weight, bool fit_view_scale);

}  // namespace tomofield::measurement
