#include "align/prediction_by_tilt.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "base/trace.h"

namespace tomofield::alignment {
namespace {

constexpr double kStep_deg = 0.25;

}  // namespace

std::vector<std::vector<float>> predictions_by_tilt(measurement::Measurement& measurement,
                                                    fit::Fit& fit) {
  const base::TraceSpan span("predict other tilts");
  const std::vector<double> tilt_deg = measurement.geometry.tilt_deg;
  std::vector<int> views(tilt_deg.size());
  std::iota(views.begin(), views.end(), 0);
  const auto predicted_at = [&](double step_deg) {
    std::ranges::transform(tilt_deg, measurement.geometry.tilt_deg.begin(),
                           [step_deg](double tilt) { return tilt + step_deg; });
    fit.reread_measurement();
    std::vector<std::vector<float>> images;
    for (auto& view : fit.predict(views, std::vector<measurement::ViewModel>(views.size())))
      images.push_back(std::move(view.predicted));
    return images;
  };
  const auto before = predicted_at(-kStep_deg);
  auto derivatives = predicted_at(kStep_deg);
  measurement.geometry.tilt_deg = tilt_deg;
  fit.reread_measurement();
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::ranges::transform(
        derivatives[v], before[v], derivatives[v].begin(),
        [](float high, float low) { return (high - low) / static_cast<float>(2 * kStep_deg); });
  }
  return derivatives;
}

}  // namespace tomofield::alignment
