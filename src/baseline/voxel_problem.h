#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/tilt_geometry.h"
#include "loss/data_term.h"
#include "projection/slab_projector.h"
#include "tilt_series/slab_views.h"

namespace tomofield::baseline {

/// What both baselines fit: ½ Σ ((scale A x + offset − b) / σ_view)² over the
/// rays that count, for densities x at the samples of `grid`. Everything is in
/// the density units of the main method. `rays` must outlive it.
class VoxelProblem {
 public:
  VoxelProblem(const geometry::TiltGeometry& geometry, projection::SampleGrid grid,
               const tilt_series::SlabViews& rays, const std::vector<double>& noise_sigma);

  const projection::SlabProjector& projector() const { return projector_; }
  const projection::SampleGrid& grid() const { return projector_.grid(); }
  std::int64_t num_rows() const { return rays_.shape().num_rows; }
  int num_slabs() const { return rays_.num_slabs(); }
  const std::vector<int>& views() const { return views_; }
  const loss::ViewModel& view_model(int view) const {
    return models_[static_cast<std::size_t>(view)];
  }
  const std::vector<loss::ViewModel>& view_models() const { return models_; }
  std::int64_t width() const { return projector_.geometry().width; }
  /// Floats of a slab's rays, [view, x, lane].
  std::size_t detector_size() const { return projector_.detector_size(views_.size()); }
  /// Rays that count.
  std::int64_t num_rays() const;

  /// Row sums of A, [view, x]: the length of each ray within the samples, at
  /// least one pixel. They are the same for every row of the detector.
  const std::vector<float>& ray_lengths() const { return ray_lengths_; }

  /// detector ← scale (scale A x + offset − b) for the rays of a slab, 0 for
  /// those that do not count. Writes the padding of `samples`. Returns sums, one each view.
  std::vector<loss::ViewSums> residuals(int slab, float* samples, float* detector) const;
  /// ½ Σ (residual / σ)² of one slab or, with added sums, of all.
  double data_loss(const std::vector<loss::ViewSums>& sums) const;

  /// samples += Aᵀ detector, of a slab.
  void backproject(const float* detector, float* samples) const {
    projector_.backward(detector, views_, samples);
  }

  /// Fits scale and offset of each view to the sums of all slabs (loss/data_term.h).
  void fit_view_models(const std::vector<loss::ViewSums>& sums);

  /// detector ← value(view) for the rays of a slab that count, 0 for the others.
  void fill_counted(int slab, const std::vector<float>& value_of_view, float* detector) const;

 private:
  void measure_ray_lengths();

  projection::SlabProjector projector_;
  const tilt_series::SlabViews& rays_;
  std::vector<int> views_;
  std::vector<loss::ViewModel> models_;
  std::vector<float> ray_lengths_;
};

/// The sums of all slabs, added in their order: the same for any thread count.
std::vector<loss::ViewSums> total(const std::vector<std::vector<loss::ViewSums>>& sums_of_slab);

}  // namespace tomofield::baseline
