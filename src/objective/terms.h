#pragma once

#include <memory>
#include <vector>

#include "objective/term.h"

namespace tomofield::objective {

/// Makes the terms of the loss in the order in which they are evaluated. A new term is a new file
/// and a line here.
std::vector<std::unique_ptr<Term>> make_terms(const TermContext& context);

/// Returns the factor on the weight of the density's variation: more than 1 if the penalty is
/// concave and there is little noise (noise_scale.h).
double variation_gain(const FitOptions& options, const measurement::Measurement& full);

}  // namespace tomofield::objective
