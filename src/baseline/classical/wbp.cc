#include "baseline/classical/wbp.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "base/enum_names.h"
#include "baseline/classical/bridge_gaps.h"
#include "baseline/classical/tilt_weights.h"
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

nlohmann::json WbpOptions::json() const {
  return {{"window", base::name_of(filter.window)},
          {"cutoff", filter.cutoff},
          {"falloff", filter.falloff}};
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
  base::parallel_for(problem.num_slabs(), [&](std::int64_t index) {
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
