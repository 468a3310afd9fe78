#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "exchange/particles/particle_list.h"
#include "output/model_file.h"
#include "output/volume_frame.h"
#include "tomofield/model.h"
#include "tomofield/options.h"

namespace tomofield::exchange {

/// The boxes in which particles are cut out.
struct ParticleBoxes {
  std::int64_t size = 0;  ///< voxels along each side
  double voxel_px = 1.0;  ///< side of a voxel in pixels of the model
  Levelling levelling{};  ///< of the volume to which places and orientations refer
};

/// Returns the STAR file of a stack of particles: NAME.star beside NAME.mrc.
std::filesystem::path particle_star(const std::filesystem::path& stack);

/// Writes the subvolumes of particles, sampled from a model, one after the other into an MRC stack
/// of volumes (ISPG 401). The particle lies on the voxel of index int(size / 2), as in RELION.
/// Writes beside it the list with the name of each subvolume (rlnImageName). Where the model has
/// no densities, the subvolume is 0. Returns the number of particles whose boxes reach outside the
/// region of interest. Throws Error if no box meets the model, or if a file cannot be written.
std::size_t write_particles(const output::Model& model, ParticleList list,
                            const ParticleBoxes& boxes, const VolumeOptions& options,
                            const std::filesystem::path& stack);

}  // namespace tomofield::exchange
