#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "field/sampling/sample_box.h"
#include "io/images/mrc.h"
#include "output/model_file.h"
#include "output/volume_frame.h"
#include "tomofield/options.h"

namespace tomofield::output {

/// The part of a model that is written.
struct VolumePart {
  std::optional<field::OrientedBox> box = {};  ///< default: region_box() with a voxel a pixel
  /// For kInt16: the density that becomes 32000, so that several volumes have one factor. Default:
  /// the largest one of the volume.
  std::optional<float> largest_density = {};
};

/// Returns the mode in which voxels of a type are stored.
io::MrcMode mrc_mode(VoxelType type);

/// Returns by what values are multiplied for kInt16, of which `largest_value` becomes ±32000, and
/// adds that to the label of the header.
double int16_factor(double largest_value, std::string& label);

/// Returns a sentence for each option of a volume that does not go with another one.
std::vector<std::string> faults_of(const VolumeOptions& options);

/// Returns the folder of a volume's copy as OME-Zarr: NAME.zarr beside NAME.mrc.
std::filesystem::path zarr_path(const std::filesystem::path& volume);

/// Checks before any work that this copy can be written. Throws Error, with `advice`, if the folder
/// exists, unless `may_replace`, if something else is there, and if one of the `inputs` lies in it.
void check_zarr(const std::filesystem::path& volume,
                const std::vector<std::filesystem::path>& inputs, bool may_replace,
                const std::string& advice);

/// Writes this copy of a volume, which may wait in an io::OutputSet.
void write_zarr(const std::filesystem::path& volume, ZarrVersion version);

/// Returns the largest absolute density in the region of interest of a model.
float largest_density(const Model& model);

/// Returns the region of interest and the whole thickness, in whole voxels of `voxel_px` pixels, as
/// reconstruct writes it. It lies along the axes of that volume.
field::OrientedBox tomogram_box(const ModelInfo& model, double voxel_px);

/// Returns the corner of a box of the volume from the view's corner in Å, along the axes of the
/// file (docs/geometry.md); 0 for one that was turned.
std::array<double, 3> corner_A(const ModelInfo& info, const field::OrientedBox& box,
                               VolumeAxes axes = VolumeAxes::kXyz);

/// Returns the factor by which the values of a volume were stored, as its label says, or 1.
double stored_factor(const io::MrcHeader& header);

/// Returns tomogram_box() where it lies in the field: turned back by the x-axis tilt and brought
/// level.
field::OrientedBox region_box(const ModelInfo& model, double voxel_px,
                              const Levelling& levelling = {});

/// Writes a box of a model as an MRC volume, in the input's units and contrast (dark input: dense
/// is low, an empty region is 0). The header has the exact voxel size and, as ORIGIN, the box's
/// corner in the volume of all of the view, in Å (0 for a box that is turned in that volume).
/// kInt16 takes a second pass over the box for the largest value, which becomes 32000; the label in
/// the header names the factor. The write is atomic and replaces an old file. Throws Error before
/// any work if `path` cannot be written or if the box lies outside of the model.
void write_volume(const Model& model, const VolumeOptions& options,
                  const std::filesystem::path& path, const VolumePart& part = {});

/// One process's part of a model that several processes hold. write_volume() with it writes the
/// region of interest in parallel: each process writes `rows`. A box that an x-axis tilt rotates is
/// sampled by the first process alone. For that it gathers the other leaves; this process has the
/// parameters [first_parameter, end_parameter).
struct VolumeShare {
  const distributed::Communicator& processes;
  base::Range rows;
  std::size_t first_parameter, end_parameter;
};
void write_volume(Model& model, const VolumeOptions& options, const std::filesystem::path& path,
                  const VolumeShare& share);

/// Passes every voxel of a box to a sink once, part by part, on any threads. It is called twice for
/// kInt16. Each of several processes passes voxels of its own.
using VoxelSource = std::function<void(const field::BoxSink&)>;

/// Returns the largest absolute density of a source, whose voxels several processes may share.
float largest_density(const VoxelSource& source, const distributed::Communicator& processes);

/// Writes densities from any source as write_volume() does. `made_by` goes into the header's label,
/// and `largest` is VolumePart::largest_density.
void write_voxels(const VoxelSource& source, const field::OrientedBox& box, const ModelInfo& info,
                  const std::string& made_by, const VolumeOptions& options,
                  const std::filesystem::path& path,
                  const distributed::Communicator& processes = distributed::Communicator::alone(),
                  std::optional<float> largest = {});

}  // namespace tomofield::output
