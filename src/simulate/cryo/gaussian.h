#pragma once

#include <cmath>
#include <numbers>

#include "simulate/phantom.h"
#include "simulate/random_ellipsoid.h"

namespace tomofield::simulate {

/// A piece of matter as a Gaussian of the electrostatic potential that it adds to that of ice.
struct Gaussian {
  Vector3 center_A{};
  double sigma_A = 1.0;
  double integral_VA3 = 0.0;  ///< over space, in V Å³

  /// Returns the potential at its centre in V.
  double peak_V() const {
    return integral_VA3 / std::pow(std::sqrt(2.0 * std::numbers::pi) * sigma_A, 3);
  }
};

/// The potential that matter adds to ice, integrated over space, in V Å³ per Da. The mean inner
/// potential is 47.88 V Å² Σ f / volume, where f are the scattering factors of atoms at angle 0 in
/// Å (H 0.529, C 2.509, N 2.211, O 1.983; Peng et al., Acta Cryst. A52, 257, 1996). Protein of mean
/// composition has 8.0 V at 1.35 g/cm³ and 1.23 Å³ per Da, vitreous ice of 0.93 g/cm³ has 4.53 V
/// (Vulović et al., J. Struct. Biol. 183, 19, 2013). RNA has 4.4 V Å³ per Da.
inline constexpr double kPotentialPerDalton_VA3 = 4.26;
inline constexpr double kVolumePerDalton_A3 = 1.23;

/// Returns the radius in Å of a sphere of protein.
inline double protein_radius_A(double mass_kDa) {
  return std::cbrt(0.75 / std::numbers::pi * kVolumePerDalton_A3 * 1e3 * mass_kDa);
}

/// Returns a Gaussian in voxels about the same origin, widened by the mean over a voxel, which has
/// a variance of 1/12 voxel² along each axis.
inline Blob blob_of(Gaussian gaussian, double voxel_size_A) {
  gaussian.sigma_A = std::hypot(gaussian.sigma_A, voxel_size_A / std::sqrt(12.0));
  return {.center = moved({}, 1.0 / voxel_size_A, gaussian.center_A),
          .sigma = gaussian.sigma_A / voxel_size_A,
          .peak = gaussian.peak_V()};
}

}  // namespace tomofield::simulate
