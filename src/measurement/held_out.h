#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/slab_views.h"
#include "measurement/view_errors.h"
#include "measurement/view_residuals.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"

namespace tomofield::measurement {

/// Views kept from the fit: in order of tilt every `every`-th one (at least 2),
/// first the one in the middle of the first `every`, and neither the first nor
/// the last of all, whose tilts nothing else covers; none if `every` is 0.
/// Indices, ascending. Throws Error if the series is too short to hold any out.
std::vector<int> held_out_views(const std::vector<double>& tilt_deg, int every);

/// How well a field predicts views that it was not fitted to.
using HeldOutError = ViewErrors;

/// The error of `views` (evaluate/view_errors.h). The sums are the same for any
/// number of threads and of processes, of which each holds some slabs of `measured`.
HeldOutError held_out_error(
    const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
    const SlabViews& measured, std::vector<int> views, std::span<const double> noise_weight,
    bool fit_view_scale,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Logs the error; returns it and that of each view, for the metrics of a run. With
/// `stopped_by_them` the same views decided when the fit stopped, and both say so.
nlohmann::json report_held_out(const HeldOutError& error, const std::vector<double>& tilt_deg,
                               bool stopped_by_them = false);

/// A view as measured and as a field predicts it: [y, x], rows of the region of
/// interest; NaN where there is no measurement.
struct PredictedView {
  std::int64_t width = 0, height = 0;
  std::vector<float> measured, predicted;
};
PredictedView predicted_view(
    const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
    const SlabViews& measured, int view, const ViewModel& model,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::measurement
