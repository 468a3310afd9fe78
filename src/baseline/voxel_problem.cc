#include "baseline/voxel_problem.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/aligned_buffer.h"
#include "base/threads/parallel.h"

namespace tomofield::baseline {

using kernels::kLanes;

VoxelProblem::VoxelProblem(const geometry::TiltGeometry& geometry, projection::SampleGrid grid,
                           const measurement::SlabViews& rays,
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

std::vector<measurement::ViewSums> VoxelProblem::residuals(const SlabPair& slabs,
                                                           std::span<const int> views,
                                                           float* samples, float* detector,
                                                           std::uint16_t lanes) const {
  const std::size_t size = detector_size(views);
  std::fill_n(detector, static_cast<std::size_t>(slabs.count) * size, 0.0f);
  projector_.forward(samples, views, detector, slabs.count);
  std::vector<measurement::ViewSums> sums(views.size());
  std::vector<std::uint16_t> mask(row_size());
  for (int slab = slabs.first; slab < slabs.end(); ++slab, detector += size) {
    float* rays = detector;
    for (std::size_t v = 0; v < views.size(); ++v, rays += width() * kLanes) {
      for (std::size_t x = 0; x < mask.size(); ++x)
        mask[x] = static_cast<std::uint16_t>(rays_.mask(slab, views[v])[x] & lanes);
      measurement::ViewModel model = view_model(views[v]);
      model.weight = 1.0;
      sums[v] += measurement::data_term(model, 1.0, rays_.rays(slab, views[v]), mask.data(),
                                        width(), rays);
    }
  }
  return sums;
}

double VoxelProblem::data_loss(const std::vector<measurement::ViewSums>& sums) const {
  double twice = 0.0;
  for (std::size_t v = 0; v < sums.size(); ++v) {
    const measurement::ViewModel& model = view_model(views_[v]);
    twice += model.weight * sums[v].squared_residual(model);
  }
  return twice / 2;
}

void VoxelProblem::fit_view_models(const std::vector<measurement::ViewSums>& sums) {
  if (!fits_scale_) return;
  std::vector<measurement::ViewModel> fitted;
  for (const int view : views_) fitted.push_back(view_model(view));
  measurement::fit_nuisances(measurement::NuisancePrior{}, sums, fitted);
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

std::vector<measurement::ViewSums> view_sums(const VoxelProblem& problem,
                                             std::span<const int> views, VoxelVolume& densities) {
  std::vector<std::vector<measurement::ViewSums>> sums(problem.num_pairs());
  for_each_pair(problem.num_slabs(), [&](const SlabPair& pair) {
    base::AlignedBuffer<float> detector(SlabPair::kMaxSlabs * problem.detector_size(views));
    sums[pair.index()] =
        problem.residuals(pair, views, densities.slab(pair.first), detector.data());
  });
  return total(sums);
}

std::vector<measurement::ViewSums> total(
    const std::vector<std::vector<measurement::ViewSums>>& sums_of_part) {
  std::vector<measurement::ViewSums> all = sums_of_part.front();
  for (std::size_t part = 1; part < sums_of_part.size(); ++part) {
    for (std::size_t v = 0; v < all.size(); ++v) all[v] += sums_of_part[part][v];
  }
  return all;
}

measurement::ViewErrors held_out_errors(const VoxelProblem& problem, const std::vector<int>& views,
                                        bool fit_view_scale, VoxelVolume& densities) {
  std::vector<double> weights;
  for (const double sigma : problem.noise_sigma()) weights.push_back(1 / (sigma * sigma));
  return measurement::view_errors(views, {view_sums(problem, views, densities)}, weights,
                                  fit_view_scale);
}

}  // namespace tomofield::baseline
