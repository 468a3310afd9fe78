#include "simulate/random_ellipsoid.h"

#include <cmath>
#include <cstddef>

namespace tomofield::simulate {

Vector3 normalized(Vector3 v) {
  const double length = std::sqrt(dot(v, v));
  for (double& x : v) x /= length;
  return v;
}

Vector3 random_direction(base::Random& random) {
  Vector3 v;
  do {
    for (double& x : v) x = random.normal();
  } while (dot(v, v) < 1e-6);  // a null vector has no direction
  return normalized(v);
}

// Gram–Schmidt on normal deviates.
std::array<Vector3, 3> random_axes(base::Random& random) {
  std::array<Vector3, 3> axes;
  for (std::size_t i = 0; i < 3; ++i) {
    double length = 0.0;
    do {
      for (double& v : axes[i]) v = random.normal();
      for (std::size_t j = 0; j < i; ++j) {
        const double overlap = dot(axes[i], axes[j]);
        for (std::size_t k = 0; k < 3; ++k) axes[i][k] -= overlap * axes[j][k];
      }
      length = std::sqrt(dot(axes[i], axes[i]));
    } while (length < 1e-3);  // nearly in the span of the others: rounding would show
    for (double& v : axes[i]) v /= length;
  }
  return axes;
}

Vector3 random_semi_axes(double shortest, double longest, base::Random& random) {
  Vector3 semi_axes;
  for (double& a : semi_axes) a = random.uniform(shortest, longest);
  semi_axes[random.below(3)] = longest;
  return semi_axes;
}

std::array<double, 6> surface_form(const std::array<Vector3, 3>& axes, const Vector3& semi_axes) {
  constexpr std::array<std::array<std::size_t, 2>, 6> kEntries{
      {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  std::array<double, 6> q{};
  for (std::size_t n = 0; n < kEntries.size(); ++n) {  // Q = Σ axis axisᵀ / semi_axis²
    const auto [row, column] = kEntries[n];
    for (std::size_t i = 0; i < 3; ++i)
      q[n] += axes[i][row] * axes[i][column] / (semi_axes[i] * semi_axes[i]);
  }
  return q;
}

}  // namespace tomofield::simulate
