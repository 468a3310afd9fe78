#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace tomofield::field {

/// A point between the vertices of one axis: its lower vertex and the weight of the upper one.
/// Points outside are moved to the end, because export may ask for the domain's last face. Points
/// within rounding of a vertex are moved to it, because kernels need not interpolate there.
struct AxisPoint {
  std::ptrdiff_t lower;
  double fraction;
  AxisPoint(double vertex, int n) {
    constexpr double kRounding = 1e-9;
    const double nearest = std::round(vertex);
    const double exact = std::abs(vertex - nearest) < kRounding * n ? nearest : vertex;
    const double clamped = std::clamp(exact, 0.0, static_cast<double>(n - 1));
    lower = std::min(static_cast<std::ptrdiff_t>(clamped), static_cast<std::ptrdiff_t>(n - 2));
    fraction = clamped - static_cast<double>(lower);
  }
};

/// Interpolates n vertices linearly to m vertices on the same length: to[o, i, :] from
/// from[o, :, :].
inline void resample_axis(const float* from, int outer, int n, int inner, int m, float* to) {
  for (int o = 0; o < outer; ++o) {
    for (int i = 0; i < m; ++i) {
      const AxisPoint at(static_cast<double>(i) * (n - 1) / (m - 1), n);
      const float fraction = static_cast<float>(at.fraction);
      const float* lower = from + (static_cast<std::ptrdiff_t>(o) * n + at.lower) * inner;
      float* out = to + (static_cast<std::ptrdiff_t>(o) * m + i) * inner;
      for (int c = 0; c < inner; ++c)
        out[c] = (1 - fraction) * lower[c] + fraction * lower[inner + c];
    }
  }
}

/// Interpolates one half of an axis linearly at half the spacing: to[o, i, :] =
/// from[o, first + i / 2, :], 0 <= i < n. The new vertices contain every old vertex of that half,
/// so that no breakpoint is lost.
inline void halve_axis(const float* from, int outer, int n, int inner, double first, float* to) {
  for (int o = 0; o < outer; ++o) {
    for (int i = 0; i < n; ++i) {
      const AxisPoint at(first + 0.5 * i, n);
      const float fraction = static_cast<float>(at.fraction);
      const float* lower = from + (static_cast<std::ptrdiff_t>(o) * n + at.lower) * inner;
      float* out = to + (static_cast<std::ptrdiff_t>(o) * n + i) * inner;
      for (int c = 0; c < inner; ++c)
        out[c] = (1 - fraction) * lower[c] + fraction * lower[inner + c];
    }
  }
}

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
