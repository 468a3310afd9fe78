#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/field.h"
#include "geometry/ray_geometry.h"
#include "loss/data_term.h"
#include "projection/ray_projector.h"
#include "reconstruct/domain.h"
#include "reconstruct/options.h"
#include "tilt_series/slab_views.h"

namespace tomofield::reconstruct {

/// Steps in which the ray engine sees every ray of a series once.
int ray_steps_per_epoch(const FitOptions& options, const tilt_series::SlabViews::Shape& shape);

/// The data term of eq. 9 over random batches of rays: each step of an epoch
/// takes one pixel, at random, of every run of as many pixels as an epoch has
/// steps, in every view, so that an epoch uses each ray once and every step has
/// all views and places. Rays that miss the region of interest or are masked do
/// not count.
class RayTerm {
 public:
  RayTerm(const geometry::RayGeometry& geometry, const tilt_series::SlabViews& measured,
          const field::Field& field, const Domain& domain, const FitOptions& options);

  int steps_per_epoch() const { return steps_per_epoch_; }

  struct Result {
    std::vector<loss::ViewSums> views;  ///< of every view
    double grad_bias = 0.0;
  };
  /// Adds the gradient of step `step` (counted from the first of the fit) by the
  /// parameters; the loss is scaled up from the step's rays to all of them.
  Result accumulate_gradient(std::int64_t step, std::span<const loss::ViewModel> models,
                             float* gradient) const;

  /// Bytes that a step needs beside the parameters, about.
  static std::size_t working_memory(const geometry::RayGeometry& geometry, const Domain& domain,
                                    const FitOptions& options,
                                    const tilt_series::SlabViews::Shape& shape);

  /// The rays of a step: those over the same row of root cells together.
  std::vector<projection::Ray> batch(std::int64_t step) const;

 private:
  const tilt_series::SlabViews& measured_;
  geometry::Extent2 roi_;
  double thickness_;
  field::RootGrid roots_;
  std::uint64_t seed_;
  int steps_per_epoch_;
  std::vector<geometry::RayBundle> bundles_;
  projection::RayProjector projector_;
};

}  // namespace tomofield::reconstruct
