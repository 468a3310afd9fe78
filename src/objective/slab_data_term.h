#pragma once

#include <memory>
#include <span>

#include "base/range.h"
#include "measurement/slab_views.h"
#include "objective/term.h"

namespace tomofield::objective {

/// Computes the data term of eq. 2 on slabs: ½ Σ weight (scale p + offset − b)² over the rays of
/// the step's views that count, where p is a line integral of the samples and b the measured one.
class SlabDataTerm : public Term {
 public:
  /// `measured` must outlive the term.
  explicit SlabDataTerm(const measurement::SlabViews& measured) : measured_(measured) {}

  std::unique_ptr<Scratch> make_scratch(const projection::SlabSampler& sampler) const override;
  bool replaces_gradient() const override { return true; }
  /// Returns 0, since the value follows from the sums of residuals.
  double add_slabs(const Step& step, const SlabBatch& batch, Scratch* scratch,
                   std::span<measurement::ViewSums> view_sums) const override;

 private:
  struct Detectors;
  void add_pixels(const Step& step, const SlabBatch& batch, base::Range pixels, float* detector,
                  std::span<measurement::ViewSums> sums) const;

  const measurement::SlabViews& measured_;
};

}  // namespace tomofield::objective
