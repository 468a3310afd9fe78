#include "baseline/classical/sirt.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "baseline/voxel_volume.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

double weigh_rays_of_slab(const VoxelProblem& problem, std::span<const int> views,
                          float* residuals) {
  double sum_of_all = 0.0;
  problem.for_each_ray(views,
                       [&](const measurement::ViewModel& model, float length, std::size_t at) {
                         // The residuals hold the view's scale once, and A does too.
                         const double weight = model.weight / (model.scale * model.scale);
                         const float factor = static_cast<float>(weight) / length;
                         float sum = 0.0f;
                         for (int l = 0; l < kLanes; ++l) {
                           float& r = residuals[at + static_cast<std::size_t>(l)];
                           sum += factor * r * r;
                           r *= factor;
                         }
                         sum_of_all += static_cast<double>(sum);
                       });
  return sum_of_all;
}

}  // namespace

double weigh_rays(const VoxelProblem& problem, const SlabPair& slabs, std::span<const int> views,
                  float* residuals) {
  double sum = 0.0;
  for (int i = 0; i < slabs.count; ++i, residuals += problem.detector_size(views))
    sum += weigh_rays_of_slab(problem, views, residuals);
  return sum;
}

void inverse_column_sums(const VoxelProblem& problem, const SlabPair& slabs,
                         std::span<const int> views, float* detector, float* inverse) {
  const auto count = static_cast<std::size_t>(slabs.count);
  for (std::size_t i = 0; i < count; ++i)
    problem.fill_weights(slabs.first + static_cast<int>(i), views,
                         detector + i * problem.detector_size(views));
  problem.backproject(views, detector, inverse, slabs.count);
  for (float& sum : std::span(inverse, count * problem.grid().size()))
    sum = sum > 0.0f ? 1.0f / sum : 0.0f;
}

void take_step(const projection::SampleGrid& grid, const SlabPair& slabs, double relaxation,
               bool non_negative, const float* inverse_columns, const float* gradient,
               float* densities) {
  const float step = static_cast<float>(relaxation);
  const float lowest = non_negative ? 0.0f : std::numeric_limits<float>::lowest();
  for (int slab = 0; slab < slabs.count; ++slab) {
    const std::ptrdiff_t first = slab * static_cast<std::ptrdiff_t>(grid.size());
    for_each_sample_row(grid, [&](const projection::SampleSegment& segment, std::ptrdiff_t row) {
      const std::ptrdiff_t end = first + row + static_cast<std::ptrdiff_t>(segment.nx) * kLanes;
      for (std::ptrdiff_t i = first + row; i < end; ++i)
        densities[i] = std::max(lowest, densities[i] - step * inverse_columns[i] * gradient[i]);
    });
  }
}

Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration) {
  Solution solution{VoxelVolume(problem.grid(), problem.num_rows()), {}, {}};
  VoxelVolume& densities = solution.densities;
  ThreadScratch scratch(problem);
  VoxelVolume inverse_columns(problem.grid(), problem.num_rows());
  for_each_pair(problem.num_slabs(), [&](const SlabPair& pair) {
    inverse_column_sums(problem, pair, problem.views(), scratch.detector(),
                        inverse_columns.slab(pair.first));
  });
  std::vector<std::vector<measurement::ViewSums>> sums(problem.num_pairs());
  for (int iteration = 0;; ++iteration) {
    const bool is_last = iteration == options.iterations;
    solution.objective.push_back(sum_over_pairs(problem.num_slabs(), [&](const SlabPair& pair) {
      float *residuals = scratch.detector(), *x = densities.slab(pair.first);
      sums[pair.index()] = problem.residuals(pair, problem.views(), x, residuals);
      const double objective = weigh_rays(problem, pair, problem.views(), residuals) / 2;
      if (is_last) return objective;
      float* gradient = scratch.samples();
      problem.backproject(problem.views(), residuals, gradient, pair.count);
      take_step(problem.grid(), pair, options.relaxation, options.non_negative,
                inverse_columns.slab(pair.first), gradient, x);
      return objective;
    }));
    const std::vector<measurement::ViewSums> all = total(sums);
    solution.data_loss.push_back(problem.data_loss(all));
    if (is_last) return solution;
    problem.fit_view_models(all);
    after_iteration({iteration + 1, solution.data_loss.back(), solution.objective.back()},
                    densities);
  }
}

}  // namespace tomofield::baseline
