#pragma once

#include <cstdint>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "objective/axis_penalty.h"
#include "objective/term.h"
#include "tomofield/options.h"

namespace tomofield::objective {

/// Sets the isotropic Fourier prior of a field.
struct FourierPriorOptions {
  double weight = 0.0;   ///< per px³ and density unit; 0 is off
  int slices = 4;        ///< sections a step, at random heights z
  int max_samples = 64;  ///< samples along the longer side of the region, at least 1 px apart
  std::uint64_t seed = 1;
  AxisPenaltyOptions axes;
};

/// Penalises streaks along x and y in the spectrum of a field (isotropic Fourier prior, eq. 7 and
/// 8). The loss is weight · volume of the region of interest · axis_penalty() of a few sections,
/// which are sampled on a coarse grid. Each step draws a new origin of the grid and new heights,
/// which depend on seed and step alone.
class FourierPrior : public Term {
 public:
  /// `field` must outlive it and may change its parameters; rebuild it when the tree changes.
  FourierPrior(const field::Field& field, const Rectangle& roi, const FourierPriorOptions& options);
  /// Makes the prior of a field that several processes share; this one has the leaves `own`.
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
  std::vector<int> leaves_;  // leaves that meet the region
};

}  // namespace tomofield::objective
