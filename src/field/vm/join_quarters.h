#pragma once

#include <array>
#include <cstddef>

namespace tomofield::field {

/// The same array of each of a leaf's four quarters, x fastest.
using Quarters = std::array<const float*, 4>;

/// The extents of an array [x, middle, y, inner] of a leaf or a factor. An array that does not
/// depend on an axis has one element there.
struct ArrayExtents {
  int x = 1, middle = 1, y = 1, inner = 1;
};

/// Joins the quarters' arrays at the vertices of the leaf, which are every second one of theirs.
/// Vertices where several quarters meet become means, and so does everything along an axis on which
/// the array does not depend. Undoes halve_axis() to rounding. All weights are positive, so that
/// the function also serves second moments.
void join_quarters(const Quarters& quarters, const ArrayExtents& extents, float* joined);

}  // namespace tomofield::field
