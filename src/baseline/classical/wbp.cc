#include "baseline/classical/wbp.h"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <vector>

#include "base/enum_names.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

bool is_extended(const VoxelProblem& problem) { return problem.grid().segments().size() > 1; }

std::vector<double> weights_of_views(const VoxelProblem& problem) {
  std::vector<double> tilts;
  for (const int view : problem.views())
    tilts.push_back(problem.projector().geometry().tilt_deg[static_cast<std::size_t>(view)]);
  return tilt_weights(tilts);
}

// Returns the constant part of A x₀ − b that is left out of each view.
std::vector<double> constants(const VoxelProblem& problem, VoxelVolume& densities) {
  std::vector<double> means;
  for (const measurement::ViewSums& s : view_sums(problem, problem.views(), densities))
    means.push_back(is_extended(problem) && s.n > 0 ? (s.p - s.b) / s.n : 0.0);
  return means;
}

// Adds x − x₀ to the samples.
void add_backprojection(const projection::SampleGrid& grid, const float* backprojection,
                        float* samples) {
  for_each_sample_row(grid, [&](const projection::SampleSegment& segment, std::ptrdiff_t row) {
    const float per_area = static_cast<float>(1.0 / (segment.hx * segment.hz));
    const std::ptrdiff_t end = row + static_cast<std::ptrdiff_t>(segment.nx) * kLanes;
    for (std::ptrdiff_t i = row; i < end; ++i) samples[i] += per_area * backprojection[i];
  });
}

}  // namespace

std::vector<double> tilt_weights(const std::vector<double>& tilt_deg) {
  const std::size_t n = tilt_deg.size();
  if (n == 1) return {std::numbers::pi};
  std::vector<std::size_t> by_tilt(n);
  std::iota(by_tilt.begin(), by_tilt.end(), std::size_t{0});
  std::ranges::stable_sort(by_tilt, {}, [&](std::size_t view) { return tilt_deg[view]; });
  const auto tilt = [&](std::size_t i) { return tilt_deg[by_tilt[i]]; };
  const double range = tilt(n - 1) - tilt(0);
  const double beyond = std::clamp(180.0 - range, 0.0, range / static_cast<double>(n - 1));
  std::vector<double> weights(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double before = i > 0 ? tilt(i) - tilt(i - 1) : beyond;
    const double after = i + 1 < n ? tilt(i + 1) - tilt(i) : beyond;
    weights[by_tilt[i]] = (before + after) / 2 * std::numbers::pi / 180;
  }
  return weights;
}

void bridge_gaps(const std::uint16_t* mask, std::int64_t width, float* rays) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto ray = [&](std::int64_t x) -> float& { return rays[x * kLanes + lane]; };
    std::int64_t last = -1;  // the last ray that counts
    for (std::int64_t x = 0; x <= width; ++x) {
      const bool is_end = x == width;
      if (!is_end && (mask[x] >> lane & 1) == 0) continue;
      const bool has_both = last >= 0 && !is_end;
      const float slope = has_both ? (ray(x) - ray(last)) / static_cast<float>(x - last) : 0.0f;
      for (std::int64_t i = last + 1; i < x; ++i)
        ray(i) = has_both ? ray(last) + slope * static_cast<float>(i - last) : 0.0f;
      last = x;
    }
  }
}

Solution reconstruct_wbp(const VoxelProblem& problem, const WbpOptions& options,
                         double mean_density, const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  densities.fill(static_cast<float>(mean_density));
  const RampFilter filter(options.filter, problem.width());
  const std::vector<double> weights = weights_of_views(problem);
  const std::vector<double> left_out = constants(problem, densities);
  const std::vector<int>& views = problem.views();
  ThreadScratch scratch(problem);
  base::parallel_for("backproject", problem.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    float* detector = scratch.detector();
    problem.residuals({slab}, views, densities.slab(slab), detector);
    for (std::size_t v = 0; v < views.size(); ++v) {
      float* rays = detector + static_cast<std::ptrdiff_t>(v) * problem.width() * kLanes;
      const float constant = static_cast<float>(left_out[v]);
      for (std::int64_t i = 0; i < problem.width() * kLanes; ++i)
        rays[i] = static_cast<float>(weights[v]) * (constant - rays[i]);
      bridge_gaps(problem.rays().mask(slab, views[v]), problem.width(), rays);
      filter.apply(rays);
    }
    float* samples = scratch.samples();
    problem.backproject(views, detector, samples);
    add_backprojection(problem.grid(), samples, densities.slab(slab));
  });
  solution.data_loss = {problem.data_loss(view_sums(problem, views, densities))};
  solution.objective = solution.data_loss;
  after_iteration({1, solution.data_loss.back(), solution.objective.back()}, densities);
  return solution;
}

}  // namespace tomofield::baseline
