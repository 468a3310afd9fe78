#pragma once

#include <span>

#include "base/range.h"

namespace tomofield::distributed {

/// Returns part `index` of `count` parts of consecutive pieces, where `work` holds the cost of each
/// piece. Every part has at least one piece, and begins where the work before it is nearest to
/// index / count of the total. There must be at least `count` pieces.
base::Range part_of(std::span<const double> work, int index, int count);

}  // namespace tomofield::distributed
