#include "measurement/view_errors.h"

#include <utility>

namespace tomofield::measurement {
namespace {

// Least squares of measured ≈ scale · predicted + offset.
ViewModel fitted_model(const ViewSums& s, double weight) {
  const double spread = s.n * s.pp - s.p * s.p;
  const bool is_flat = !(spread > 1e-9 * s.n * s.pp);
  const double scale = is_flat ? 1.0 : (s.n * s.pb - s.p * s.b) / spread;
  return {scale, s.n > 0 ? (s.b - scale * s.p) / s.n : 0.0, weight};
}

}  // namespace

ViewErrors view_errors(std::vector<int> views, const SlabSums& sums,
                       std::span<const double> noise_weight, bool fit_view_scale) {
  ViewErrors error;
  error.views = std::move(views);
  double squares = 0, rays = 0;
  for (std::size_t v = 0; v < error.views.size(); ++v) {
    const double weight = noise_weight[static_cast<std::size_t>(error.views[v])];
    ViewSums view;
    for (const auto& slab : sums) view += slab[v];
    error.models.push_back(fit_view_scale ? fitted_model(view, weight)
                                          : ViewModel{1.0, 0.0, weight});
    const double view_squares = weight * view.squared_residual(error.models.back());
    error.view_error.push_back(view.n > 0 ? view_squares / view.n : 0.0);
    squares += view_squares;
    rays += view.n;
  }
  error.total = rays > 0 ? squares / rays : 0.0;
  return error;
}

}  // namespace tomofield::measurement
