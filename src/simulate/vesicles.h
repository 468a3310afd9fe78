#pragma once

#include <array>
#include <vector>

#include "base/random.h"
#include "simulate/phantom.h"
#include "simulate/random_ellipsoid.h"

namespace tomofield::simulate {

/// A closed membrane, or two nested ones, around a lumen. It is an ellipsoid in voxels.
struct Vesicle {
  Vector3 center{};
  std::array<Vector3, 3> axes{};
  Vector3 semi_axes{};        ///< of the outermost surface
  std::array<double, 6> q{};  ///< of the outermost surface, in the order of Ellipsoid::q
  double radius = 0.0;        ///< the longest semi-axis
  double lumen_ratio = 0.0;   ///< surface of the lumen / outermost surface

  /// Returns the point at a position in the unit sphere that the outermost surface is mapped to.
  Vector3 point(const Vector3& in_unit_sphere) const;
};

/// Places vesicles that do not touch each other in an extended slab and adds their membranes, the
/// spikes on some of them and the grain in their lumens to the phantom. textured_content.h has the
/// recipe.
std::vector<Vesicle> place_vesicles(base::Random random, Phantom& phantom);

/// Returns true if a sphere about a position touches no membrane. It may be inside of a lumen or
/// outside of all vesicles.
bool is_clear_of_membranes(const std::vector<Vesicle>& vesicles, const Vector3& position,
                           double radius);

}  // namespace tomofield::simulate
