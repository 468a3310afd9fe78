#pragma once

#include <cstdint>
#include <vector>

#include "simulate/random_ellipsoid.h"

namespace tomofield::simulate {

/// Remembers which places of a box about the origin are taken, in cubes of 20 Å.
class Occupancy {
 public:
  explicit Occupancy(const Vector3& half_lengths_A);

  /// Takes all cubes whose centres are within a distance of a point.
  void take(const Vector3& point_A, double radius_A);
  /// Returns true if the cube of a point is not taken. Outside of the box everything is free.
  bool is_free(const Vector3& point_A) const;

 private:
  static constexpr double kCube_A = 20.0;
  std::int64_t cube(double position_A, std::size_t axis) const;
  std::size_t index(std::int64_t x, std::int64_t y, std::int64_t z) const;

  Vector3 half_A_;
  std::array<std::int64_t, 3> counts_{};
  std::vector<bool> taken_;  // [z, y, x]
};

}  // namespace tomofield::simulate
