#include "measurement/noise_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/statistics.h"

namespace tomofield::measurement {
namespace {

constexpr double kLargestResidual = 4.0;  // in standard deviations of the noise

// Steep views of a sound series have up to this many times the usual variance, because structure
// beside the volume shows in them. They are needed, so they keep their weights.
constexpr double kSoundPart = 1.75;
constexpr double kLeastWeight = 0.1;  // of a view, over the one by its measured noise

}  // namespace

void fit_noise(std::span<const double> noise_weight, std::span<const int> fitted,
               std::span<const ViewSums> sums, std::span<ViewModel> models) {
  std::vector<std::size_t> views;
  std::vector<double> variance;  // of the residuals of `views`, over that of their noise
  for (const int v : fitted) {
    const auto view = static_cast<std::size_t>(v);
    if (sums[view].n == 0) continue;
    views.push_back(view);
    variance.push_back(noise_weight[view] * sums[view].limited_squares / sums[view].n);
  }
  if (views.empty()) return;
  const double usual = base::median({variance.begin(), variance.end()});
  double measured = 0.0, weighted = 0.0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    ViewModel& model = models[views[i]];
    const double weight = noise_weight[views[i]], rays = sums[views[i]].n;
    const bool is_sound = variance[i] <= kSoundPart * usual;
    const double part = is_sound ? 1.0 : std::pow(kSoundPart * usual / variance[i], 2);
    model.weight = weight * std::max(part, kLeastWeight);
    model.largest_residual = kLargestResidual * std::max(variance[i], 1.0) / std::sqrt(weight);
    measured += rays * weight;
    weighted += rays * model.weight;
  }
  if (weighted > 0)
    for (const std::size_t view : views) models[view].weight *= measured / weighted;
}

}  // namespace tomofield::measurement
