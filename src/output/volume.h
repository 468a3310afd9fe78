#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "distributed/communicator.h"
#include "field/sampling/sample_box.h"
#include "io/mrc.h"
#include "output/model_file.h"
#include "tomofield/options.h"

namespace tomofield::output {

struct VolumeOptions {
  std::optional<field::Box> box;             ///< default: the region of interest, one voxel a pixel
  io::MrcMode mode = io::MrcMode::kFloat32;  ///< or kFloat16, or kInt16, which is scaled
  VolumeAxes axes = VolumeAxes::kXyz;
  bool invert = false;  ///< the other contrast than the input's
};

/// The region of interest and the whole thickness, in whole voxels of `voxel_px` pixels.
field::Box region_box(const ModelInfo& model, double voxel_px);

/// Writes a box of a model as an MRC volume: in the input's units and contrast
/// (dark input: dense is low, an empty region 0), with exact voxel size, and with
/// IMOD's origin: minus the box's corner in the view, in Å (0 for a rotated box).
/// kInt16 takes a second pass over the box for the largest value, which becomes
/// 32000; the label in the header names the factor.
/// Atomic; replaces what is there. Throws Error before any work if `path` cannot be
/// written or the box lies outside of what the model holds.
void write_volume(const Model& model, const VolumeOptions& options,
                  const std::filesystem::path& path);

/// The same for the region of interest of a model that processes share: each writes `rows` of it,
/// in parallel. A box that an x-axis tilt rotates is sampled by the first process alone, which for
/// that takes the leaves of the others, [first, end) of whose parameters this process has.
struct VolumeShare {
  const distributed::Communicator& processes;
  field::BoxRows rows;
  std::size_t first_parameter, end_parameter;
};
void write_volume(Model& model, const VolumeOptions& options, const std::filesystem::path& path,
                  const VolumeShare& share);

/// Passes every voxel of a box to a sink once, part by part, on any threads; called
/// twice for kInt16. Each of several processes passes voxels of its own.
using VoxelSource = std::function<void(const field::BoxSink&)>;

/// The same for densities from anywhere; `made_by` goes into the header's label.
void write_voxels(const VoxelSource& source, const field::Box& box, const ModelInfo& info,
                  const std::string& made_by, const VolumeOptions& options,
                  const std::filesystem::path& path,
                  const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::output
