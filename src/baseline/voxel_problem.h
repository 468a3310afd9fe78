#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "baseline/voxel_volume.h"
#include "geometry/tilt_geometry.h"
#include "kernels/lanes.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "projection/slab_projector.h"

namespace tomofield::baseline {

/// The handling of single views.
struct ViewHandling {
  std::vector<int> held_out = {};  ///< views kept from the fit, ascending
  bool fit_scale = false;          ///< per-view scale and offset as nuisances
};

/// The problem that all baselines fit: ½ Σ ((scale A x + offset − b) / σ_view)² over the rays that
/// count, for densities x at the samples of `grid`. Everything is in the density units of the main
/// method. `rays` must outlive the problem.
///
/// A detector is a slab's rays of some views, one view after the other: [view, x, lane]. The
/// detectors of a pair of slabs follow each other, detector_size(views) floats apart.
class VoxelProblem {
 public:
  VoxelProblem(const geometry::TiltGeometry& geometry, projection::SampleGrid grid,
               const measurement::SlabViews& rays, const std::vector<double>& noise_sigma,
               const ViewHandling& handling = {});

  const projection::SlabProjector& projector() const { return projector_; }
  const projection::SampleGrid& grid() const { return projector_.grid(); }
  const measurement::SlabViews& rays() const { return rays_; }
  std::int64_t num_rows() const { return rays_.shape().num_rows; }
  int num_slabs() const { return rays_.num_slabs(); }
  std::size_t num_pairs() const { return static_cast<std::size_t>(SlabPair::number(num_slabs())); }
  /// Returns the fitted views, ascending.
  const std::vector<int>& views() const { return views_; }
  const measurement::ViewModel& view_model(int view) const {
    return models_[static_cast<std::size_t>(view)];
  }
  /// Returns the noise of all views.
  const std::vector<double>& noise_sigma() const { return noise_sigma_; }
  std::int64_t width() const { return projector_.geometry().width; }
  /// Returns the number of floats of a detector of the fitted views, or of `views`.
  std::size_t detector_size() const { return detector_size(views_); }
  std::size_t detector_size(std::span<const int> views) const {
    return projector_.detector_size(views.size());
  }
  /// Returns the number of rays of the fitted views that count.
  std::int64_t num_rays() const;

  /// Returns the row sums of A for a view, [x]: the length of each ray within the samples, at least
  /// one pixel. They are the same for every row of the detector.
  std::span<const float> ray_lengths(int view) const {
    return std::span(ray_lengths_).subspan(static_cast<std::size_t>(view * width()), row_size());
  }
  /// Calls body(view model, ray length, at) for each pixel of a detector row of these views. The
  /// lanes of the pixel begin at index `at` of their detector.
  template <typename Body>
  void for_each_ray(std::span<const int> views, Body&& body) const {
    std::size_t at = 0;
    for (const int view : views) {
      for (const float length : ray_lengths(view)) {
        body(view_model(view), length, at);
        at += kernels::kLanes;
      }
    }
  }

  /// Sets detector ← scale (scale A x + offset − b) for the rays of these slabs and views, and 0
  /// for rays that do not count. Only rays of these `lanes`, a bit each, count. Writes the padding
  /// of `samples`. Returns the sums, one a view.
  std::vector<measurement::ViewSums> residuals(const SlabPair& slabs, std::span<const int> views,
                                               float* samples, float* detector,
                                               std::uint16_t lanes = kAllLanes) const;
  /// Returns ½ Σ (residual / σ)² from the sums of the fitted views, of one slab or added up over
  /// several.
  double data_loss(const std::vector<measurement::ViewSums>& sums) const;

  /// Sets samples ← Aᵀ detector for `num_slabs` slabs.
  void backproject(std::span<const int> views, const float* detector, float* samples,
                   int num_slabs = 1) const {
    projector_.backward(detector, views, samples, num_slabs);
  }

  bool fits_view_models() const { return fits_scale_; }
  /// Fits the scale and the offset of each view to the sums of all slabs
  /// (measurement/view_residuals.h), if the problem fits them at all.
  void fit_view_models(const std::vector<measurement::ViewSums>& sums);

  /// Sets detector ← 1 / σ² of the view for the rays of a slab that count, and 0 for the others.
  void fill_weights(int slab, std::span<const int> views, float* detector) const;

 private:
  static constexpr std::uint16_t kAllLanes = 0xffff;
  std::size_t row_size() const { return static_cast<std::size_t>(width()); }
  void measure_ray_lengths();

  projection::SlabProjector projector_;
  const measurement::SlabViews& rays_;
  std::vector<double> noise_sigma_;
  bool fits_scale_;
  std::vector<int> views_;
  std::vector<measurement::ViewModel> models_;  // [view], of all views
  std::vector<float> ray_lengths_;              // [view, x], of all views
};

/// Returns the sums of these views over all slabs for the densities of a volume. Writes its
/// padding.
std::vector<measurement::ViewSums> view_sums(const VoxelProblem& problem,
                                             std::span<const int> views, VoxelVolume& densities);

/// Returns the sums over all parts, added in their order: the same for any thread count.
std::vector<measurement::ViewSums> total(
    const std::vector<std::vector<measurement::ViewSums>>& sums_of_part);

/// Computes how well densities predict `views` (measurement/view_residuals.h). Writes the padding
/// of `densities`.
measurement::ViewErrors held_out_errors(const VoxelProblem& problem, const std::vector<int>& views,
                                        bool fit_view_scale, VoxelVolume& densities);

}  // namespace tomofield::baseline
