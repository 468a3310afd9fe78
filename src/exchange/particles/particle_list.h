#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "field/sampling/sample_box.h"
#include "io/tables/star_file.h"
#include "output/model_file.h"

namespace tomofield::exchange {

/// Where a particle is in the volume of a model, and how its subvolume is turned.
struct Particle {
  field::Point place_px{};  ///< pixels of the model; pixel i covers [i, i + 1)
  field::Rotation volume_from_box = field::kNoRotation;
};

/// The particles of one tomogram, and RELION's tables that describe them: a row a particle.
struct ParticleList {
  io::StarTable optics{"optics", {}};
  io::StarTable table{"particles", {}};
  std::vector<Particle> particles;
};

/// Reads the particles of a model's tomogram. Throws Error with the file and the row.
///
/// - A STAR file of RELION 5 has the distance of each particle from the centre of the tomogram in Å
///   (rlnCenteredCoordinateXAngst and so on). The particle lies at the zero-based index
///
///       distance / pixel size + N / 2
///
///   of the unbinned tomogram (ParticleSet::getParticleCoordDecenteredPixel), so half a pixel above
///   the middle of our volume. Its subvolume is turned by rlnTomoSubtomogramRot, Tilt and Psi.
///   Offsets (rlnOriginXAngst) stay offsets from the centre of the subvolume. Of several
///   tomograms (rlnTomoName), that of this name is taken: `tomogram`, or that of the model's file,
///   which is empty for a model in memory.
/// - Any other file is the text that IMOD's model2point writes: places in voxels of the volume that
///   reconstruct wrote, in the order of its axes; the middle of the first voxel is (0.5, 0.5, 0).
ParticleList read_particle_list(const std::filesystem::path& path,
                                const std::filesystem::path& model_file,
                                const output::ModelInfo& model, const std::string& tomogram);

}  // namespace tomofield::exchange
