#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "exchange/particles/particle_stack.h"
#include "field/sampling/sample_box.h"
#include "io/saving/output_lock.h"
#include "output/model_file.h"
#include "tomofield/model.h"
#include "tomofield/options.h"
#include "tomofield/volume_file.h"

namespace tomofield::exchange {

/// The files of an export: a volume, or the particles of a list.
struct ExportFiles {
  std::filesystem::path output;          ///< NAME.mrc
  std::filesystem::path model = {};      ///< empty for a model in memory
  std::filesystem::path particles = {};  ///< the list; empty: a volume
  VolumeOptions volume = {};
  bool overwrite = false;
};

/// Checks that the results of an export can be written, and locks them. `advice` says what a user
/// may do about files that exist. Throws Error if they cannot be written.
std::vector<io::OutputLock> claim_export(const ExportFiles& files, const std::string& advice);

/// The place of a volume in a model.
struct ExportPlace {
  std::optional<field::OrientedBox> box = {};  ///< in the volume; none: the region of interest
  double voxel_px = 1.0;                       ///< side of the voxels of that region
  std::optional<Levelling> level = {};         ///< of the volume in which the box lies
};

/// Returns the box of a volume in the field. Warns if a box reaches beyond the region of interest.
/// Throws Error for angles that bring no specimen level.
field::OrientedBox box_in_field(const output::Model& model, const ExportPlace& place);

/// Writes a box of a model as a volume. Throws Error as output::write_volume() does.
void export_volume(const output::Model& model, const field::OrientedBox& box,
                   const ExportFiles& files);

/// Writes the subvolumes of the particles of a list, and the list (write_particles()). `tomogram`
/// names the tomogram whose particles they are (read_particle_list()). Throws Error for boxes that
/// cannot be, and as those functions do.
CutParticles export_particles(const output::Model& model, const ParticleBoxes& boxes,
                              const std::string& tomogram, const ExportFiles& files);

}  // namespace tomofield::exchange
