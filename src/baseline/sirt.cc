#include "baseline/sirt.h"

#include <algorithm>
#include <limits>
#include <span>

#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

// The inverse column sums of W A over the rays that count; 0 where no ray passes.
VoxelVolume inverse_column_sums(const VoxelProblem& problem, ThreadScratch& scratch) {
  VoxelVolume inverse(problem.grid(), problem.num_rows());
  std::vector<float> weights;
  for (const loss::ViewModel& model : problem.view_models())
    weights.push_back(static_cast<float>(model.weight));
  base::parallel_for(problem.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    problem.fill_counted(slab, weights, scratch.detector());
    problem.backproject(scratch.detector(), inverse.slab(slab));
    for (float& sum : std::span(inverse.slab(slab), problem.grid().size()))
      sum = sum > 0.0f ? 1.0f / sum : 0.0f;
  });
  return inverse;
}

// Multiplies residuals by W R; returns Σ residual² W R.
double weigh_rays(const VoxelProblem& problem, float* residuals) {
  double objective = 0.0;
  for (const int view : problem.views()) {
    const loss::ViewModel& model = problem.view_model(view);
    // The residuals carry the view's scale once, and A does too.
    const double weight = model.weight / (model.scale * model.scale);
    for (std::int64_t x = 0; x < problem.width(); ++x) {
      const std::int64_t ray = view * problem.width() + x;
      const float factor =
          static_cast<float>(weight) / problem.ray_lengths()[static_cast<std::size_t>(ray)];
      float sum = 0.0f;
      for (int l = 0; l < kLanes; ++l) {
        float& r = residuals[ray * kLanes + l];
        sum += factor * r * r;
        r *= factor;
      }
      objective += static_cast<double>(sum);
    }
  }
  return objective;
}

void take_step(const SirtOptions& options, const projection::SampleGrid& grid,
               const float* inverse_columns, const float* gradient, float* densities) {
  const float relaxation = static_cast<float>(options.relaxation);
  const float lowest = options.non_negative ? 0.0f : std::numeric_limits<float>::lowest();
  for_each_sample_row(grid, [&](const projection::SampleSegment& segment, std::ptrdiff_t row) {
    const std::ptrdiff_t end = row + static_cast<std::ptrdiff_t>(segment.nx) * kLanes;
    for (std::ptrdiff_t i = row; i < end; ++i)
      densities[i] = std::max(lowest, densities[i] - relaxation * inverse_columns[i] * gradient[i]);
  });
}

}  // namespace

Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  ThreadScratch scratch(problem.detector_size(), problem.grid().size());
  const VoxelVolume inverse_columns = inverse_column_sums(problem, scratch);
  std::vector<std::vector<loss::ViewSums>> sums(static_cast<std::size_t>(problem.num_slabs()));
  for (int iteration = 0;; ++iteration) {
    const bool is_last = iteration == options.iterations;
    solution.objective.push_back(sum_over_slabs(problem.num_slabs(), [&](int slab) {
      float* residuals = scratch.detector();
      sums[static_cast<std::size_t>(slab)] =
          problem.residuals(slab, densities.slab(slab), residuals);
      const double objective = weigh_rays(problem, residuals) / 2;
      if (is_last) return objective;
      float* gradient = scratch.cleared_samples();
      problem.backproject(residuals, gradient);
      take_step(options, problem.grid(), inverse_columns.slab(slab), gradient,
                densities.slab(slab));
      return objective;
    }));
    const std::vector<loss::ViewSums> all = total(sums);
    solution.data_loss.push_back(problem.data_loss(all));
    if (is_last) return solution;
    if (options.fit_view_scale) problem.fit_view_models(all);
    after_iteration({iteration + 1, solution.data_loss.back(), solution.objective.back()},
                    densities);
  }
}

}  // namespace tomofield::baseline
