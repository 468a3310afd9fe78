#include "baseline/voxel_problem.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/aligned_buffer.h"
#include "baseline/voxel_volume.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {

using kernels::kLanes;

VoxelProblem::VoxelProblem(const geometry::TiltGeometry& geometry, projection::SampleGrid grid,
                           const tilt_series::SlabViews& rays,
                           const std::vector<double>& noise_sigma)
    : projector_(geometry, std::move(grid)), rays_(rays), views_(noise_sigma.size()) {
  std::iota(views_.begin(), views_.end(), 0);
  for (const double sigma : noise_sigma) models_.push_back({1.0, 0.0, 1.0 / (sigma * sigma)});
  measure_ray_lengths();
}

void VoxelProblem::measure_ray_lengths() {
  base::AlignedBuffer<float> ones(grid().size()), detector(detector_size());
  for_each_sample_row(grid(), [&](const projection::SampleSegment& segment, std::ptrdiff_t row) {
    std::fill_n(ones.data() + row, static_cast<std::ptrdiff_t>(segment.nx) * kLanes, 1.0f);
  });
  projector_.forward(ones.data(), views_, detector.data());
  ray_lengths_.resize(detector_size() / kLanes);
  for (std::size_t ray = 0; ray < ray_lengths_.size(); ++ray)
    ray_lengths_[ray] = std::max(1.0f, detector[ray * kLanes]);
}

std::int64_t VoxelProblem::num_rays() const {
  std::int64_t count = 0;
  for (const int view : views_) count += rays_.num_valid(view);
  return count;
}

std::vector<loss::ViewSums> VoxelProblem::residuals(int slab, float* samples,
                                                    float* detector) const {
  std::fill_n(detector, detector_size(), 0.0f);
  projector_.forward(samples, views_, detector);
  std::vector<loss::ViewSums> sums;
  for (const int view : views_) {
    loss::ViewModel model = view_model(view);
    model.weight = 1.0;
    sums.push_back(loss::data_term(model, 1.0, rays_.rays(slab, view), rays_.mask(slab, view),
                                   width(), detector + view * width() * kLanes));
  }
  return sums;
}

double VoxelProblem::data_loss(const std::vector<loss::ViewSums>& sums) const {
  double twice = 0.0;
  for (std::size_t v = 0; v < sums.size(); ++v)
    twice += models_[v].weight * sums[v].squared_residual(models_[v]);
  return twice / 2;
}

void VoxelProblem::fit_view_models(const std::vector<loss::ViewSums>& sums) {
  loss::fit_nuisances(loss::NuisancePrior{}, sums, models_);
}

void VoxelProblem::fill_counted(int slab, const std::vector<float>& value_of_view,
                                float* detector) const {
  for (const int view : views_) {
    const std::uint16_t* mask = rays_.mask(slab, view);
    const float value = value_of_view[static_cast<std::size_t>(view)];
    float* ray = detector + view * width() * kLanes;
    for (std::int64_t x = 0; x < width(); ++x, ray += kLanes) {
      for (int l = 0; l < kLanes; ++l) ray[l] = (mask[x] >> l & 1) != 0 ? value : 0.0f;
    }
  }
}

std::vector<loss::ViewSums> total(const std::vector<std::vector<loss::ViewSums>>& sums_of_slab) {
  std::vector<loss::ViewSums> all = sums_of_slab.front();
  for (std::size_t slab = 1; slab < sums_of_slab.size(); ++slab) {
    for (std::size_t v = 0; v < all.size(); ++v) all[v] += sums_of_slab[slab][v];
  }
  return all;
}

}  // namespace tomofield::baseline
