#pragma once

#include <algorithm>
#include <cstddef>

namespace tomofield::field {

/// A point between vertices of one axis: lower vertex and weight of the upper.
/// Points outside are moved to the end: export may ask for the domain's last face.
struct AxisPoint {
  std::ptrdiff_t lower;
  double fraction;
  AxisPoint(double vertex, int n) {
    const double clamped = std::clamp(vertex, 0.0, static_cast<double>(n - 1));
    lower = std::min(static_cast<std::ptrdiff_t>(clamped), static_cast<std::ptrdiff_t>(n - 2));
    fraction = clamped - static_cast<double>(lower);
  }
};

/// Σ_r V_r(a) M_r(b, c) at one point: V [na, rank], M [nb, nc, rank].
inline double sum_of_products(const float* vector, const float* matrix, const AxisPoint& a,
                              const AxisPoint& b, const AxisPoint& c, int nc, int rank) {
  const float* v = vector + a.lower * rank;
  const float* m = matrix + (b.lower * nc + c.lower) * rank;
  const std::ptrdiff_t next_b = static_cast<std::ptrdiff_t>(nc) * rank;
  const double w00 = (1 - b.fraction) * (1 - c.fraction), w01 = (1 - b.fraction) * c.fraction;
  const double w10 = b.fraction * (1 - c.fraction), w11 = b.fraction * c.fraction;
  double sum = 0.0;
  for (int r = 0; r < rank; ++r) {
    const double value = (1 - a.fraction) * static_cast<double>(v[r]) +
                         a.fraction * static_cast<double>(v[rank + r]);
    sum += value * (w00 * static_cast<double>(m[r]) + w01 * static_cast<double>(m[rank + r]) +
                    w10 * static_cast<double>(m[next_b + r]) +
                    w11 * static_cast<double>(m[next_b + rank + r]));
  }
  return sum;
}

/// to[o, i, :] = from[o, first + i / 2, :] by linear interpolation, 0 <= i < n:
/// the vertices of one half of an axis at half the spacing, which contain
/// every vertex of that half, so that no breakpoint is lost.
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

}  // namespace tomofield::field
