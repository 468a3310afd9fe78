#include "baseline/voxel_problem.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/aligned_buffer.h"
#include "base/parallel.h"

namespace tomofield::baseline {

using kernels::kLanes;

VoxelProblem::VoxelProblem(const geometry::TiltGeometry& geometry, projection::SampleGrid grid,
                           const tilt_series::SlabViews& rays,
                           const std::vector<double>& noise_sigma, const ViewHandling& handling)
    : projector_(geometry, std::move(grid)),
      rays_(rays),
      noise_sigma_(noise_sigma),
      fits_scale_(handling.fit_scale) {
  for (int view = 0; view < geometry.num_views(); ++view) {
    if (!std::ranges::binary_search(handling.held_out, view)) views_.push_back(view);
  }
  for (const double sigma : noise_sigma) models_.push_back({1.0, 0.0, 1.0 / (sigma * sigma)});
  measure_ray_lengths();
}

void VoxelProblem::measure_ray_lengths() {
  std::vector<int> all(models_.size());
  std::iota(all.begin(), all.end(), 0);
  base::AlignedBuffer<float> ones(grid().size()), detector(projector_.detector_size(all.size()));
  for_each_sample_row(grid(), [&](const projection::SampleSegment& segment, std::ptrdiff_t row) {
    std::fill_n(ones.data() + row, static_cast<std::ptrdiff_t>(segment.nx) * kLanes, 1.0f);
  });
  projector_.forward(ones.data(), all, detector.data());
  ray_lengths_.resize(all.size() * row_size());
  for (std::size_t ray = 0; ray < ray_lengths_.size(); ++ray)
    ray_lengths_[ray] = std::max(1.0f, detector[ray * kLanes]);
}

std::int64_t VoxelProblem::num_rays() const {
  std::int64_t count = 0;
  for (const int view : views_) count += rays_.num_valid(view);
  return count;
}

std::vector<loss::ViewSums> VoxelProblem::residuals(int slab, std::span<const int> views,
                                                    float* samples, float* detector,
                                                    std::uint16_t lanes) const {
  std::fill_n(detector, projector_.detector_size(views.size()), 0.0f);
  projector_.forward(samples, views, detector);
  std::vector<loss::ViewSums> sums;
  std::vector<std::uint16_t> mask(row_size());
  for (const int view : views) {
    for (std::size_t x = 0; x < mask.size(); ++x)
      mask[x] = static_cast<std::uint16_t>(rays_.mask(slab, view)[x] & lanes);
    loss::ViewModel model = view_model(view);
    model.weight = 1.0;
    sums.push_back(
        loss::data_term(model, 1.0, rays_.rays(slab, view), mask.data(), width(), detector));
    detector += width() * kLanes;
  }
  return sums;
}

double VoxelProblem::data_loss(const std::vector<loss::ViewSums>& sums) const {
  double twice = 0.0;
  for (std::size_t v = 0; v < sums.size(); ++v) {
    const loss::ViewModel& model = view_model(views_[v]);
    twice += model.weight * sums[v].squared_residual(model);
  }
  return twice / 2;
}

void VoxelProblem::fit_view_models(const std::vector<loss::ViewSums>& sums) {
  if (!fits_scale_) return;
  std::vector<loss::ViewModel> fitted;
  for (const int view : views_) fitted.push_back(view_model(view));
  loss::fit_nuisances(loss::NuisancePrior{}, sums, fitted);
  for (std::size_t v = 0; v < views_.size(); ++v)
    models_[static_cast<std::size_t>(views_[v])] = fitted[v];
}

void VoxelProblem::fill_weights(int slab, std::span<const int> views, float* detector) const {
  for (const int view : views) {
    const std::uint16_t* mask = rays_.mask(slab, view);
    const float weight = static_cast<float>(view_model(view).weight);
    for (std::int64_t x = 0; x < width(); ++x, detector += kLanes) {
      for (int l = 0; l < kLanes; ++l) detector[l] = (mask[x] >> l & 1) != 0 ? weight : 0.0f;
    }
  }
}

std::vector<loss::ViewSums> view_sums(const VoxelProblem& problem, std::span<const int> views,
                                      VoxelVolume& densities) {
  std::vector<std::vector<loss::ViewSums>> sums(static_cast<std::size_t>(problem.num_slabs()));
  base::parallel_for(problem.num_slabs(), [&](std::int64_t index) {
    const int slab = static_cast<int>(index);
    base::AlignedBuffer<float> detector(problem.projector().detector_size(views.size()));
    sums[static_cast<std::size_t>(slab)] =
        problem.residuals(slab, views, densities.slab(slab), detector.data());
  });
  return total(sums);
}

std::vector<loss::ViewSums> total(const std::vector<std::vector<loss::ViewSums>>& sums_of_slab) {
  std::vector<loss::ViewSums> all = sums_of_slab.front();
  for (std::size_t slab = 1; slab < sums_of_slab.size(); ++slab) {
    for (std::size_t v = 0; v < all.size(); ++v) all[v] += sums_of_slab[slab][v];
  }
  return all;
}

}  // namespace tomofield::baseline
