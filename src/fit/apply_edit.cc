#include "fit/apply_edit.h"

#include <algorithm>
#include <utility>

namespace tomofield::fit {

void apply_edit(const field::QuadtreeEdit& edit, field::Field& field, Adam::State& optimizer) {
  const auto origins = field.edit(edit, {&optimizer.m, &optimizer.v});
  std::vector<std::int64_t> steps;
  for (const field::LeafOrigin& origin : origins) {
    const auto first = optimizer.leaf_steps.begin() + origin.leaf;
    const int count = origin.kind == field::LeafOrigin::Kind::kUnion ? 4 : 1;
    steps.push_back(*std::min_element(first, first + count));
  }
  optimizer.leaf_steps = std::move(steps);
}

}  // namespace tomofield::fit
