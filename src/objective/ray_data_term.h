#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/ray_geometry.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "objective/term.h"
#include "projection/ray_projector.h"
#include "tomofield/options.h"

namespace tomofield::objective {

/// Where rays count: they must meet the region of interest, and densities outside the support are
/// 0.
struct RayRegion {
  Rectangle roi;
  geometry::Extent2 support;
};

/// Returns the number of steps in which the ray engine sees every ray of a series once.
int ray_steps_per_epoch(const ObjectiveOptions& options,
                        const measurement::SlabViews::Shape& shape);

/// The data term of eq. 9 over random batches of rays: each step of an epoch
/// takes one pixel, at random, of every run of as many pixels as an epoch has
/// steps, in every view, so that an epoch uses each ray once and every step has
/// all views and places. Rays that miss the region of interest or are masked do
/// not count.
class RayDataTerm : public Term {
 public:
  RayDataTerm(const geometry::RayGeometry& geometry, const measurement::SlabViews& measured,
              const field::Field& field, const RayRegion& region, const ObjectiveOptions& options);

  int steps_per_epoch() const { return steps_per_epoch_; }

  TermValue add_field(const Step& step, float* gradient,
                      std::span<measurement::ViewSums> view_sums) const override;

  /// Bytes that a step needs beside the parameters, about.
  static std::size_t working_memory(const geometry::RayGeometry& geometry,
                                    const field::Quadtree& tree, const ObjectiveOptions& options,
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
