#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "field/field.h"
#include "geometry/ray_geometry.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "projection/ray_projector.h"

namespace tomofield::objective {

/// What the ray engine is told of the field's domain and of its batches.
struct RayTermOptions {
  geometry::Roi roi;
  geometry::Extent2 support;       ///< where densities count
  int subsets = 16;                ///< steps an epoch, unless `rays_per_step` says otherwise
  std::int64_t rays_per_step = 0;  ///< about; 0: all rays of an epoch over `subsets`
  int ray_samples = 0;             ///< N_max of eq. 10; 0: one a pixel of a leaf's diagonal
  std::uint64_t seed = 1;
};

/// Steps in which the ray engine sees every ray of a series once.
int ray_steps_per_epoch(const RayTermOptions& options, const measurement::SlabViews::Shape& shape);

/// The data term of eq. 9 over random batches of rays: each step of an epoch
/// takes one pixel, at random, of every run of as many pixels as an epoch has
/// steps, in every view, so that an epoch uses each ray once and every step has
/// all views and places. Rays that miss the region of interest or are masked do
/// not count.
class RayTerm {
 public:
  RayTerm(const geometry::RayGeometry& geometry, const measurement::SlabViews& measured,
          const field::Field& field, const RayTermOptions& options);

  int steps_per_epoch() const { return steps_per_epoch_; }

  struct Result {
    std::vector<measurement::ViewSums> views;  ///< of every view
    double grad_bias = 0.0;
  };
  /// Adds the gradient of step `step` (counted from the first of the fit) by the
  /// parameters; the loss is scaled up from the step's rays to all of them.
  Result accumulate_gradient(std::int64_t step, std::span<const measurement::ViewModel> models,
                             float* gradient) const;

  /// Bytes that a step needs beside the parameters, about.
  static std::size_t working_memory(const geometry::RayGeometry& geometry,
                                    const field::Quadtree& tree, const RayTermOptions& options,
                                    const measurement::SlabViews::Shape& shape);

  /// The rays of a step: those over the same row of root cells together.
  std::vector<projection::Ray> batch(std::int64_t step) const;

 private:
  const measurement::SlabViews& measured_;
  geometry::Extent2 roi_;
  double thickness_;
  field::RootGrid roots_;
  std::uint64_t seed_;
  int steps_per_epoch_;
  std::vector<geometry::RayBundle> bundles_;
  projection::RayProjector projector_;
};

}  // namespace tomofield::objective
