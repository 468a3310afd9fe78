#pragma once

#include <filesystem>
#include <vector>

#include "simulate/cryo/gaussian.h"

namespace tomofield::simulate {

/// A kind of particle whose density is in a file.
struct ParticleFile {
  std::filesystem::path path;
  double count = 0.0;  ///< particles in the field of view, on average
};

/// Makes a particle of an MRC density, in which high is dense, about the centre of the file's box.
/// A map has no scale of its own: the voxels above half of its 99.9th percentile get the mean
/// potential of protein above ice, kPotentialPerDalton_VA3 / kVolumePerDalton_A3. Voxels below a
/// tenth of that percentile count as solvent. Cubes of about 8 Å, or single voxels if these are
/// larger, become one Gaussian each, whose σ is 0.45 of the cube's side.
///
/// Throws Error for a file without a voxel size, without a density above 0, or with more than
/// 50 000 such cubes.
std::vector<Gaussian> read_density(const std::filesystem::path& path);

}  // namespace tomofield::simulate
