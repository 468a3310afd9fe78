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

/// The rays and densities that count. Rays must meet the region of interest. Densities outside the
/// support are 0.
struct RayRegion {
  Rectangle roi;
  geometry::Extent2 support;
};

/// Computes the data term of eq. 9 on random batches of rays. Let an epoch have n steps
/// (FitOptions::subsets). Each view
/// is divided into runs of n pixels, and every step takes another random pixel of each run. So an
/// epoch uses each ray once, and every step has rays of all views and places. Rays that miss the
/// region of interest or are masked do not count.
class RayDataTerm : public Term {
 public:
  /// `measured` and `field` must outlive the term.
  RayDataTerm(const geometry::RayGeometry& geometry, const measurement::SlabViews& measured,
              const field::Field& field, const RayRegion& region, const FitOptions& options);

  int steps_per_epoch() const { return steps_per_epoch_; }

  TermValue add_field(const Step& step, float* gradient,
                      std::span<measurement::ViewSums> view_sums) const override;

  /// Estimates the bytes that a step needs in addition to the parameters.
  static std::size_t working_memory(const geometry::RayGeometry& geometry,
                                    const field::Quadtree& tree, const RayRegion& region,
                                    const FitOptions& options,
                                    const measurement::SlabViews::Shape& shape);

  /// Returns the rays of a step, sorted by the row of root cells that they cross.
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
