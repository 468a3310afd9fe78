#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "base/volume.h"
#include "simulate/cryo/specimen.h"

namespace tomofield::simulate {

/// Returns a STAR file with the particles whose centres lie in the field of view. Coordinates are
/// in voxels of the truth, where voxel i covers [i, i + 1), as rlnCoordinateX, Y and Z; angles are
/// rlnAngleRot, Tilt and Psi; the kind is tomofieldParticleKind.
std::string particle_list(const CryoSpecimen& specimen);

/// Returns the kinds of particles that such a file has; none if it is not there, or another one.
/// A kind names a file, and no other folder.
std::set<std::string> listed_kinds(const std::filesystem::path& list);

/// Returns the density of a kind of particle in V above ice, in the orientation of zero angles, in
/// a cube of an even number of voxels with the particle's origin in its centre.
base::Volume reference_density(const ParticleKind& kind, double voxel_size_A);

/// Returns a volume [z, y, x] of the phantom's shape that is 1 within 25 Å of the middle surface of
/// a membrane, and 0 elsewhere.
base::Volume membrane_label(const CryoSpecimen& specimen, double voxel_size_A);

}  // namespace tomofield::simulate
