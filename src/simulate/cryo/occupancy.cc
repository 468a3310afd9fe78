#include "simulate/cryo/occupancy.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tomofield::simulate {

Occupancy::Occupancy(const Vector3& half_lengths_A) : half_A_(half_lengths_A) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    counts_[axis] = static_cast<std::int64_t>(std::ceil(2.0 * half_A_[axis] / kCube_A));
  taken_.resize(static_cast<std::size_t>(counts_[0] * counts_[1] * counts_[2]));
}

std::int64_t Occupancy::cube(double position_A, std::size_t axis) const {
  return static_cast<std::int64_t>(std::floor((position_A + half_A_[axis]) / kCube_A));
}

std::size_t Occupancy::index(std::int64_t x, std::int64_t y, std::int64_t z) const {
  return static_cast<std::size_t>((z * counts_[1] + y) * counts_[0] + x);
}

void Occupancy::take(const Vector3& point_A, double radius_A) {
  std::array<std::int64_t, 3> first{}, last{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    first[axis] = std::max<std::int64_t>(cube(point_A[axis] - radius_A, axis), 0);
    last[axis] = std::min(cube(point_A[axis] + radius_A, axis), counts_[axis] - 1);
  }
  const auto offset = [&](std::int64_t i, std::size_t axis) {
    return kCube_A * (static_cast<double>(i) + 0.5) - half_A_[axis] - point_A[axis];
  };
  for (std::int64_t z = first[2]; z <= last[2]; ++z)
    for (std::int64_t y = first[1]; y <= last[1]; ++y)
      for (std::int64_t x = first[0]; x <= last[0]; ++x) {
        const Vector3 d{offset(x, 0), offset(y, 1), offset(z, 2)};
        if (dot(d, d) <= radius_A * radius_A) taken_[index(x, y, z)] = true;
      }
}

bool Occupancy::is_free(const Vector3& point_A) const {
  std::array<std::int64_t, 3> at{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    at[axis] = cube(point_A[axis], axis);
    if (at[axis] < 0 || at[axis] >= counts_[axis]) return true;
  }
  return !taken_[index(at[0], at[1], at[2])];
}

}  // namespace tomofield::simulate
