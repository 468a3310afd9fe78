#pragma once

#include <cstdint>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "objective/axis_penalty.h"
#include "objective/term.h"
#include "tomofield/options.h"

namespace tomofield::objective {

struct FourierPriorOptions {
  double weight = 0.0;   ///< per px³ and density unit; 0 is off
  int slices = 4;        ///< random heights z a step
  int max_samples = 64;  ///< of the longer side of the region, at least 1 px apart
  std::uint64_t seed = 1;
  AxisPenaltyOptions axes;
};

/// Isotropic Fourier prior (eq. 7 and 8) of a field: `weight` · volume of the
/// region of interest · axis_penalty of a few sections across it, on a coarse
/// grid whose origin and heights are new in every step and depend on seed and
/// step alone. Rings are measured anew in every step: their transform costs less
/// than the samples, which the axis lines need anyway.
class FourierPrior : public Term {
 public:
  /// `field` must outlive it and may change its parameters; rebuild it when the tree changes.
  FourierPrior(const field::Field& field, const Rectangle& roi, const FourierPriorOptions& options);
  /// Of a field that processes share, of which this one has the leaves `own`.
  FourierPrior(const field::Field& field, const Rectangle& roi, const FourierPriorOptions& options,
               const distributed::Communicator& processes, base::Range own);

  /// Adds the gradient of the own leaves to `gradient` (all parameters). Runs on all threads, with
  /// the same bits for any number of them.
  TermValue add_gradient(std::int64_t step, float* gradient) const;
  TermValue add_field(const Step& step, float* gradient,
                      std::span<measurement::ViewSums>) const override {
    return add_gradient(step.number, gradient);
  }

  const SliceShape& shape() const { return shape_; }

 private:
  struct LeafSamples;
  std::vector<LeafSamples> leaf_samples(std::int64_t step) const;

  const field::Field& field_;
  Rectangle roi_;
  FourierPriorOptions options_;
  const distributed::Communicator& processes_;
  base::Range own_;
  double spacing_ = 1.0;
  SliceShape shape_;
  std::vector<int> leaves_;  // that meet the region
};

}  // namespace tomofield::objective
