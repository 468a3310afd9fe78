#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/random.h"
#include "simulate/cryo/gaussian.h"

namespace tomofield::simulate {

/// Describes a kind of protein complex.
struct ProteinKind {
  std::string name;
  double mass_kDa = 100.0;
  int fold = 1;              ///< copies about the z axis
  bool is_dihedral = false;  ///< with twofold axes across it, which double the copies
  double domain_kDa = 25.0;  ///< mass of the spheres of which the complex is built

  int copies() const { return is_dihedral ? 2 * fold : fold; }
};

/// Returns where a point goes by the `copy`-th operation of the kind's symmetry; 0 leaves it.
Vector3 symmetric_copy(const ProteinKind& kind, int copy, const Vector3& point);

/// Makes a complex about the origin: a compact random assembly of spheres (domains), which grows
/// from the centre outwards in all its symmetric copies at once. Domains touch each other and leave
/// clefts between them. They are filled with Gaussians of about 2 kDa, 13.5 Å apart, whose weights
/// vary by a fifth. All together they have the mass of the kind. The same random numbers give the
/// same complex.
std::vector<Gaussian> make_protein(const ProteinKind& kind, base::Random random);

/// Returns the largest distance from the origin of a centre of the Gaussians.
double radius_A(std::span<const Gaussian> gaussians);

}  // namespace tomofield::simulate
