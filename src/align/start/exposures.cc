#include "align/start/exposures.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "geometry/tilt_geometry.h"
#include "kernels/lanes.h"

namespace tomofield::alignment {
namespace {

constexpr double kPart = 0.3;  // of the contrast

}  // namespace

double ViewSums::deviation() const {
  return n > 0.0 ? std::sqrt(std::max(0.0, squares / n - mean() * mean())) : 0.0;
}

std::vector<ViewSums> sums_of_views(const measurement::Measurement& measurement,
                                    const distributed::Communicator& processes) {
  const measurement::SlabViews& rays = *measurement.rays;
  const std::int64_t first = std::int64_t{rays.own().begin} * kernels::kLanes;
  const std::int64_t end =
      std::min(std::int64_t{rays.own().end} * kernels::kLanes, rays.shape().num_rows);
  std::vector<ViewSums> views(rays.shape().num_views);
  base::parallel_for("sum up views", std::ssize(views), [&](std::int64_t v) {
    ViewSums& sums = views[static_cast<std::size_t>(v)];
    for (std::int64_t y = first; y < end; ++y)
      for (std::int64_t x = 0; x < rays.shape().width; ++x) {
        if (!rays.counts(static_cast<int>(v), x, y)) continue;
        const auto value = static_cast<double>(rays.ray(static_cast<int>(v), x, y));
        sums.n += 1.0;
        sums.values += value;
        sums.squares += value * value;
      }
  });
  processes.allreduce_sum(std::span(views), &ViewSums::n, &ViewSums::values, &ViewSums::squares);
  return views;
}

bool exposures_differ(const measurement::Measurement& measurement,
                      const distributed::Communicator& processes) {
  const std::vector<ViewSums> views = sums_of_views(measurement, processes);
  const std::vector<std::size_t> by_tilt = geometry::order_of_tilts(measurement.geometry.tilt_deg);
  std::vector<double> jumps, contrasts;
  for (std::size_t i = 1; i + 1 < by_tilt.size(); ++i) {
    const ViewSums& view = views[by_tilt[i]];
    const double usual = (views[by_tilt[i - 1]].mean() + views[by_tilt[i + 1]].mean()) / 2;
    jumps.push_back(std::abs(view.mean() - usual));
    contrasts.push_back(view.deviation());
  }
  return !jumps.empty() && base::median(jumps) > kPart * base::median(contrasts);
}

}  // namespace tomofield::alignment
