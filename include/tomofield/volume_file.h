#pragma once

#include <tomofield/model.h>
#include <tomofield/options.h>
#include <tomofield/tomogram.h>

#include <filesystem>

namespace tomofield {

/// A volume file to be written.
struct VolumeFile {
  std::filesystem::path path;  ///< "NAME.mrc"
  VolumeOptions options = {};
  bool overwrite = false;  ///< replace an existing file
};

/// Writes a box of a model as an MRC volume, as `tomofield export` does: in the input's units and
/// contrast, with the voxel size and the box's place in the header. Throws Error for a box that
/// cannot be sampled or lies outside of the model, and for a file that cannot be written.
void export_volume(const Model& model, const SampleBox& box, const VolumeFile& file);

/// Reads an MRC file, a volume or a stack of images, as floats with the voxel size along x (0 if
/// the header has none). Throws Error for a file that cannot be read, and for too little memory.
Tomogram read_mrc(const std::filesystem::path& path);

/// Writes a volume in memory as an MRC file of 32-bit floats with its voxel size. Throws Error for
/// a voxel size that is none, for values that are not as many as the voxels, and for a file that
/// cannot be written.
void write_mrc(const Tomogram& volume, const std::filesystem::path& path, bool overwrite = false);

}  // namespace tomofield
