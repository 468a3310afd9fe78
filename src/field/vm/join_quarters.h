#pragma once

#include <array>
#include <cstddef>

namespace tomofield::field {

/// The same array of a leaf's four quarters, x fastest.
using Quarters = std::array<const float*, 4>;

/// An array [x, middle, y, inner] of a leaf or a factor: one that does not
/// depend on an axis has one element there.
struct ArrayExtents {
  int x = 1, middle = 1, y = 1, inner = 1;
};

/// The quarters' arrays put together at a leaf's vertices, which are every
/// second one of theirs: those where several quarters meet, and all of an axis
/// that the array does not depend on, become means. Undoes halve_axis() to
/// rounding; all weights are positive, so that it serves second moments as well.
void join_quarters(const Quarters& quarters, const ArrayExtents& extents, float* joined);

}  // namespace tomofield::field
