#include "objective/answer_pull.h"

#include <cstddef>

namespace tomofield::objective {

class AnswerPull::OfLeaves : public LeafPass {
 public:
  OfLeaves(const AnswerPull& term, std::span<const int> leaves) : term_(term), leaves_(leaves) {}

  TermValue add_leaf(std::size_t index, float* gradient) override {
    const field::Field& field = term_.field_;
    const auto weight = static_cast<float>(term_.weight_);
    const auto leaf = leaves_[index];
    double squares = 0.0;
    for (std::size_t i = field.offset(leaf); i < field.offset(leaf + 1); ++i) {
      const float distance = field.parameters()[i] - term_.answer_[i];
      gradient[i] += weight * distance;
      squares += static_cast<double>(distance) * static_cast<double>(distance);
    }
    return {.value = 0.5 * term_.weight_ * squares};
  }

 private:
  const AnswerPull& term_;
  std::span<const int> leaves_;
};

std::unique_ptr<Term::LeafPass> AnswerPull::leaf_pass(const Step&,
                                                      std::span<const int> leaves) const {
  const bool is_on = weight_ > 0 && !answer_.empty();
  return is_on ? std::make_unique<OfLeaves>(*this, leaves) : nullptr;
}

}  // namespace tomofield::objective
