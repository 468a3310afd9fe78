#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "kernels/total_variation.h"
#include "objective/term.h"

namespace tomofield::objective {

/// The side to which the differences of a step go, along x and along z.
struct DifferenceSides {
  bool backward_x = false, backward_z = false;
};
/// Draws the sides of a step.
DifferenceSides difference_sides(std::uint64_t seed, std::int64_t step);

/// Computes the isotropic total variation of the density on the samples of slabs
/// (kernels/total_variation.h): weight · Σ penalty(|∇ density|) · area of a sample. Forward
/// differences alone would treat the two sides of an edge differently, so each step draws the sides
/// of its differences.
class DensityVariation : public Term {
 public:
  /// `weight` is per pixel of area and density unit; 0 is off.
  DensityVariation(double weight, const kernels::VariationPenalty& penalty, std::uint64_t seed)
      : weight_(weight), penalty_(penalty), seed_(seed) {}

  std::unique_ptr<Scratch> make_scratch(const projection::SlabSampler& sampler) const override;
  double add_slabs(const Step& step, const SlabBatch& batch, Scratch* scratch,
                   std::span<measurement::ViewSums> view_sums) const override;

 private:
  struct Rows;
  struct SamplesOfSegment;
  double add_samples(const Step& step, const SlabBatch& batch, const SamplesOfSegment& part,
                     Rows& rows) const;
  kernels::SlabVariation variation_of(const SlabBatch& batch, std::size_t segment,
                                      std::int64_t step) const;

  double weight_;
  kernels::VariationPenalty penalty_;
  std::uint64_t seed_;
};

/// Computes the total variation of the factors of each leaf (field::Field::parameter_variation).
class FactorVariation : public Term {
 public:
  /// The field must outlive the term. A weight of 0 is off.
  FactorVariation(const field::Field& field, double weight,
                  const kernels::VariationPenalty& penalty)
      : field_(field), weight_(weight), penalty_(penalty) {}

  std::unique_ptr<LeafPass> leaf_pass(const Step& step, std::span<const int> leaves) const override;

 private:
  class OfLeaves;

  const field::Field& field_;
  double weight_;
  kernels::VariationPenalty penalty_;
};

}  // namespace tomofield::objective
