#pragma once

#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "base/random.h"

namespace tomofield::base {

/// Returns 0, 1, …, count − 1 in random order (Fisher and Yates); every order is equally likely.
inline std::vector<std::size_t> shuffled(std::size_t count, Random random) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
  return order;
}

}  // namespace tomofield::base
