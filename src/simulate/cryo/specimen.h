#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "simulate/cryo/density_file.h"
#include "simulate/cryo/protein.h"
#include "simulate/phantom.h"

namespace tomofield::simulate {

/// A particle of the specimen. `euler_deg` are RELION's rot, tilt and psi, which turn the
/// reference of its kind into the specimen.
struct PlacedParticle {
  std::size_t kind = 0;
  Vector3 center_px{};  ///< relative to the volume's centre
  Vector3 euler_deg{};
};

/// A kind of particle with its reference, a density about the origin.
struct ParticleKind {
  std::string name;
  std::vector<Gaussian> reference;
};

/// A specimen as cryo-EM sees it. Densities are the electrostatic potential in V above that of the
/// ice, which has 0.
struct CryoSpecimen {
  Phantom phantom;
  /// Points on the middle surfaces of membranes, about 11 Å apart, in voxels from the centre.
  std::vector<Vector3> membrane_points_px;
  std::vector<ParticleKind> kinds;
  std::vector<PlacedParticle> particles;  ///< all, also outside the field of view
};

/// Makes the specimen of yardstick D: a slab of ice that goes on outside the field of view, with
/// what is listed here. Counts are those of 256 × 256 × 112 voxels of 10 Å and grow with the
/// volume. What would overlap with earlier content is dropped after some tries.
///
///   organelles   1 vesicle of U(700, 1200) Å, which the faces of the slab cut
///   vesicles     7 of U(200, 450) Å; semi-axes U(0.8, 1) of the radius
///   receptors    proteins of 250 kDa on membranes, one for 250 × 250 Å²
///   filaments    10 like actin: 42 kDa every 27.5 Å, turned by −166.6°, U(800, 3000) Å long
///   ribosomes    40 asymmetric complexes of 3.2 MDa
///   proteasomes  30 of 720 kDa with symmetry D7
///   carboxylases 60 of 550 kDa with symmetry D4
///   enzymes      400 of 150 kDa without symmetry
///
/// Particles of `files` take the place of the last four. Their kinds have the names of the files
/// without the extension. Throws Error for two files of one name, and as read_density() does.
///
/// The shapes of all other proteins are drawn with the seed. Every Gaussian is widened by the mean
/// over a voxel, whose variance is 1/12 voxel².
CryoSpecimen make_cryo_specimen(const CellOptions& options, double voxel_size_A,
                                std::span<const ParticleFile> files = {});

}  // namespace tomofield::simulate
