#pragma once

#include <array>
#include <vector>

#include "base/random.h"
#include "simulate/cryo/gaussian.h"

namespace tomofield::simulate {

/// A point of a membrane's middle surface.
struct SurfacePoint {
  Vector3 position_A{};
  Vector3 normal{};      ///< outwards, of length 1
  double area_A2 = 0.0;  ///< of the surface that it stands for
};

/// A closed lipid bilayer: an ellipsoid about its centre.
struct VesicleShape {
  Vector3 center_A{};
  std::array<Vector3, 3> axes{};  ///< orthonormal
  Vector3 semi_axes_A{};          ///< of the middle surface
};

/// Returns points that cover the middle surface evenly, at most about `spacing_A` apart.
std::vector<SurfacePoint> surface_points(const VesicleShape& shape, double spacing_A);

/// Half of the distance between the two sheets of head groups of a bilayer.
inline constexpr double kHalfBilayer_A = 20.0;

/// Adds a bilayer at a point of its middle surface: head groups in two sheets that are 40 Å apart,
/// and tails in the middle, each as a Gaussian of σ = 5.5 Å. Heads add 34 V Å to ice and tails
/// 10 V Å. The sum of 78 V Å is that of DOPC, with 1303 Å³ and 67.4 Å² a lipid (Kučerka et al.,
/// Biophys. J. 95, 2356, 2008) and C₄₄H₈₄NO₈P in the formula of kPotentialPerDalton_VA3.
void add_bilayer(const SurfacePoint& point, std::vector<Gaussian>& gaussians);

}  // namespace tomofield::simulate
