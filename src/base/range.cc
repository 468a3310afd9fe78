#include "base/range.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"

namespace tomofield::base {
namespace {

// Returns the first piece of a part. It leaves a piece at least to each part before and after it.
int first_piece(std::span<const double> work, int index, int count) {
  const double all = std::accumulate(work.begin(), work.end(), 0.0);
  const double wanted = all * index / count;
  const int pieces = static_cast<int>(work.size());
  int first = 0;
  double before = 0.0;
  for (; first < pieces; ++first) {
    const double after = before + work[static_cast<std::size_t>(first)];
    if (std::abs(after - wanted) > std::abs(before - wanted)) break;
    before = after;
  }
  return std::clamp(first, index, pieces - (count - index));
}

}  // namespace

Range part_of(std::span<const double> work, int index, int count) {
  TOMOFIELD_CHECK(static_cast<int>(work.size()) >= count, "a piece for every part");
  return {first_piece(work, index, count), first_piece(work, index + 1, count)};
}

}  // namespace tomofield::base
