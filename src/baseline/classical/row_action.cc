#include "baseline/classical/row_action.h"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "baseline/voxel_volume.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {

using kernels::kLanes;

namespace {

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

}  // namespace tomofield::baseline
