#pragma once

#include <array>

#include "base/random.h"

namespace tomofield::simulate {

using Vector3 = std::array<double, 3>;

inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Returns start + step · direction.
inline Vector3 moved(const Vector3& start, double step, const Vector3& direction) {
  return {start[0] + step * direction[0], start[1] + step * direction[1],
          start[2] + step * direction[2]};
}

/// Returns a vector scaled to length 1.
Vector3 normalized(Vector3 v);

/// Draws a vector of length 1. All directions are equally likely.
Vector3 random_direction(base::Random& random);

/// Draws three orthonormal vectors. All orientations are equally likely.
std::array<Vector3, 3> random_axes(base::Random& random);

/// Draws the semi-axes of an ellipsoid: a random one is `longest`, the others are uniform between
/// `shortest` and it.
Vector3 random_semi_axes(double shortest, double longest, base::Random& random);

/// Returns the matrix Q of an ellipsoid about the origin, pᵀ Q p = 1, in the order of Ellipsoid::q.
std::array<double, 6> surface_form(const std::array<Vector3, 3>& axes, const Vector3& semi_axes);

}  // namespace tomofield::simulate
