#pragma once

#include <tomofield/model.h>
#include <tomofield/options.h>
#include <tomofield/tomogram.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace tomofield {

/// A volume file to be written.
struct VolumeFile {
  std::filesystem::path path;  ///< "NAME.mrc"
  VolumeOptions options = {};
  bool overwrite = false;  ///< replace an existing file
};

/// The place of a volume in a model.
struct VolumePlace {
  std::optional<SampleBox> box = {};  ///< none: the region of interest
  double voxel_px = 1.0;              ///< side of the voxels of that region
  /// Brings the specimen level: a box, which then has no angles of its own, lies in the levelled
  /// volume.
  std::optional<Levelling> level = {};
};

/// Writes a box of a model as an MRC volume, as `tomofield export` does: in the input's units and
/// contrast, with the voxel size and the box's place in the header. Throws Error for a box that
/// cannot be sampled or lies outside of the model, and for a file that cannot be written.
void export_volume(const Model& model, const VolumePlace& place, const VolumeFile& file);

/// Returns how far the specimen was found to be from level by the alignment before the fit, as
/// `tomofield export --level found` does. Throws Error for a model that was not read from a file or
/// written to one, without its NAME_align.json, and if that could not tell an angle.
Levelling found_levelling(const Model& model);

/// Particles that are cut out of a model, each into a cube.
struct ParticleCuts {
  std::filesystem::path list;           ///< a STAR file of RELION 5, or the text of model2point
  std::int64_t size = 0;                ///< voxels along each side of a cube
  double voxel_px = 1.0;                ///< side of a voxel
  std::string tomogram = {};            ///< its name in the list; empty: that of the model's file
  std::optional<Levelling> level = {};  ///< of the volume to which the list refers
};

/// The numbers of particles that were cut out.
struct CutParticles {
  std::size_t count = 0;
  std::size_t num_beyond = 0;  ///< their cubes reach outside the region of interest
};

/// Writes the subvolumes of particles as a stack of volumes, and the list beside it as NAME.star,
/// as `tomofield export --particles` does. The options of the file but for the type and the
/// contrast stay at their defaults. Throws Error for a list that cannot be read or has no particles
/// of the model, and for files that cannot be written.
CutParticles export_particles(const Model& model, const ParticleCuts& cuts, const VolumeFile& file);

/// Reads an MRC file, a volume or a stack of images, as floats with the voxel size along x (0 if
/// the header has none) and its ORIGIN. Throws Error for a file that cannot be read, and for too
/// little memory.
Tomogram read_mrc(const std::filesystem::path& path);

/// Writes a volume in memory as an MRC file of 32-bit floats with its voxel size and ORIGIN. Throws
/// Error for a voxel size that is none, an origin that is not finite, values that are not as many
/// as the voxels, and for a file that cannot be written.
void write_mrc(const Tomogram& volume, const std::filesystem::path& path, bool overwrite = false);

}  // namespace tomofield
