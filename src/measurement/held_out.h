#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"

namespace tomofield::measurement {

/// Returns the views kept from the fit: in order of tilt every `every`-th view (at least 2), from
/// the one in the middle of the first `every` on, without the first and the last of all, whose
/// tilts nothing else covers; none if `every` is 0. Indices, ascending. Throws Error if the series
/// is too short to hold any out.
std::vector<int> held_out_views(const std::vector<double>& tilt_deg, int every);

/// Returns how well a field predicts `views` that it was not fitted to (view_errors()). The result
/// is the same for any number of threads and of processes, of which each holds some slabs of
/// `measured`.
ViewErrors held_out_error(
    const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
    const SlabViews& measured, std::vector<int> views, std::span<const double> noise_weight,
    bool fit_view_scale,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// A view as measured and as a field predicts it: [y, x], rows of the region of
/// interest; NaN where there is no measurement.
struct PredictedView {
  std::int64_t width = 0, height = 0;
  std::vector<float> measured, predicted;
};
/// Returns the bytes of a predicted view.
inline std::size_t bytes_of_prediction(const SlabViews::Shape& views) {
  return 2 * sizeof(float) * static_cast<std::size_t>(views.width * views.num_rows);
}
/// Predicts some views, on every process, each with its model. All of them are in memory together.
std::vector<PredictedView> predicted_views(
    const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
    const SlabViews& measured, std::span<const int> views, std::span<const ViewModel> models,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::measurement
