#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/volume.h"

namespace tomofield::evaluate {

/// Where the particles of a kind are, and what they look like.
struct ParticleReference {
  std::string kind;
  base::Volume density;  ///< a cube of an even side with the particle's origin in its centre
  std::vector<std::array<double, 3>> positions_px;  ///< voxel i covers [i, i + 1)
};

/// Returns the kinds of particles in a list, in the order in which they occur first. Throws Error
/// for a list without them.
std::vector<std::string> particle_kinds(const std::filesystem::path& list);

/// Returns the file of the density of a kind, particle_KIND.mrc beside the list.
std::filesystem::path density_of(const std::filesystem::path& list, const std::string& kind);

/// Reads a list of particles as `simulate --yardstick d` writes it, and the densities beside it,
/// particle_KIND.mrc, in the order in which kinds occur in the list. Throws Error with the file for
/// what is missing.
std::vector<ParticleReference> read_particles(const std::filesystem::path& list);

/// How well particles of a kind are found.
struct PickScore {
  std::string kind;
  std::int64_t num_particles = 0;  ///< farther from the faces than their radius
  double radius_A = 0.0;
  double average_precision = 0.0;
};

/// Looks for the particles of a kind by the correlation with its reference in 96 orientations, in
/// voxels of about 20 Å (means over smaller ones). A pick is true if its place is nearer to a
/// particle of the kind than the particle's radius, and if no higher pick took that particle. The
/// radius is that of a sphere outside of which the reference stays below a tenth of its largest
/// voxel. High is dense. Throws Error if the reference has other voxels than the volume.
PickScore pick_score(const base::Volume& volume, const ParticleReference& particle);

}  // namespace tomofield::evaluate
