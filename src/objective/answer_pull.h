#pragma once

#include <memory>
#include <span>

#include "field/field.h"
#include "objective/term.h"

namespace tomofield::objective {

/// Pulls plain vertices p towards the answer a of the learned prior: ½ weight · Σ (p − a)². With
/// the data term this is the mean of what the views and the prior say, each frequency by how well
/// the views measured it, as in regularisation by denoising (Romano, Elad and Milanfar 2017).
class AnswerPull : public Term {
 public:
  /// `answer` has the places of the field's parameters; both must outlive the term. Without an
  /// answer, or with a weight of 0, the term is off.
  AnswerPull(const field::Field& field, std::span<const float> answer, double weight)
      : field_(field), answer_(answer), weight_(weight) {}

  std::unique_ptr<LeafPass> leaf_pass(const Step& step, std::span<const int> leaves) const override;

 private:
  class OfLeaves;

  const field::Field& field_;
  std::span<const float> answer_;
  double weight_;
};

}  // namespace tomofield::objective
