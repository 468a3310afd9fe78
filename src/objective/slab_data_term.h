#pragma once

#include "measurement/slab_views.h"
#include "objective/term.h"

namespace tomofield::objective {

/// Computes the data term of eq. 2 on slabs: ½ Σ weight (scale p + offset − b)² over the rays of
/// the step's views that count, where p is a line integral of the samples and b the measured one.
class SlabDataTerm : public Term {
 public:
  /// `measured` must outlive the term.
  explicit SlabDataTerm(const measurement::SlabViews& measured) : measured_(measured) {}

  bool replaces_gradient() const override { return true; }
  /// Returns 0, since the value follows from the sums of residuals.
  double add_slabs(const Step& step, const SlabBatch& batch,
                   std::span<measurement::ViewSums> view_sums) const override;

 private:
  const measurement::SlabViews& measured_;
};

}  // namespace tomofield::objective
