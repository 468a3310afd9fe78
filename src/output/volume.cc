#include "output/volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/plausible.h"
#include "base/trace.h"
#include "distributed/gathered_arrays.h"
#include "io/images/mrc_format.h"
#include "io/images/ome_zarr.h"
#include "io/images/zarr_store.h"
#include "io/saving/atomic_folder.h"
#include "io/saving/output_files.h"
#include "io/saving/output_set.h"
#include "io/saving/output_target.h"
#include "io/tables/text_lines.h"
#include "output/box_bounds.h"
#include "output/model_input_record.h"
#include "output/sample_model.h"
#include "output/sampling_time.h"
#include "tomofield/error.h"

namespace tomofield::output {
namespace {

using field::BoxPart;
using field::OrientedBox;
using field::Point;

constexpr const char* kMadeBy = "density field";

// Gathers the parameters on the first process.
void gather_parameters(const VolumeShare& share, field::Field& field) {
  distributed::GatheredArrays arrays(share.processes, share.first_parameter, share.end_parameter);
  const std::size_t parameters = arrays.add(field.parameters());
  arrays.read_on_root([&] {
    field.keep_only({});
    auto into = field.parameters().begin();
    arrays.hand_out(parameters, [&](std::span<const float> piece) {
      if (piece.data() != std::to_address(into)) std::ranges::copy(piece, into);
      into += std::ssize(piece);
    });
  });
}

// Refuses a box that does not meet the field, because all its voxels would be zero.
void require_inside(const Model& model, const BoxBounds& box) {
  const BoxBounds field = field_bounds(model);
  const auto axis = box.axis_apart(field);
  if (!axis) return;
  throw Error(fmt::format(
      "the box lies outside of the model: its {} runs from {:.6g} to {:.6g} px, the "
      "model's from {:.6g} to {:.6g}",
      "xyz"[*axis], box.low[*axis], box.high[*axis], field.low[*axis], field.high[*axis]));
}

}  // namespace

std::array<double, 3> corner_A(const ModelInfo& info, const OrientedBox& box, VolumeAxes axes) {
  if (!box.is_aligned()) return {0.0, 0.0, 0.0};
  const auto [nx, ny, nz] = box.size;
  Point corner = box.position({0.0, 0.0, 0.0});
  if (axes == VolumeAxes::kXzy) {
    // Rows count down from the upper face.
    const double top = box.position({0.0, 0.0, static_cast<double>(nz)})[2];
    corner = {corner[0], info.geometry.thickness - top, corner[1]};
  }
  for (double& value : corner) value *= info.pixel_size_A;
  return corner;
}

float largest_density(const VoxelSource& source, const distributed::Communicator& processes) {
  std::mutex mutex;
  float largest = 0.0f;
  source([&](const BoxPart& part) {
    float here = 0.0f;
    for (const float value : part.values) here = std::max(here, std::abs(value));
    const std::lock_guard lock(mutex);
    largest = std::max(largest, here);
  });
  return static_cast<float>(processes.allreduce_max(static_cast<double>(largest)));
}

namespace {

// Writes densities times `scale` in the file's axes.
class PartWriter {
 public:
  PartWriter(io::MrcWriter& file, const OrientedBox& box, VolumeAxes axes, double scale)
      : file_(file), box_(box), axes_(axes), scale_(static_cast<float>(scale)) {}

  void operator()(const BoxPart& part) const {
    const std::int64_t nx = box_.size[0];
    std::vector<float> values;
    const auto append_row = [&](std::int64_t section, std::int64_t row) {
      const float* from = part.values.data() + (section * part.num_rows + row) * nx;
      for (std::int64_t x = 0; x < nx; ++x) values.push_back(scale_ * from[x] + 0.0f);  // no −0
    };
    if (axes_ == VolumeAxes::kXyz) {
      for (std::int64_t s = 0; s < part.num_sections; ++s) {
        values.clear();
        for (std::int64_t r = 0; r < part.num_rows; ++r) append_row(s, r);
        file_.write_rows(part.first_section + s, part.first_row, part.num_rows, values);
      }
      return;
    }
    const std::int64_t first = box_.size[2] - part.first_section - part.num_sections;
    for (std::int64_t r = 0; r < part.num_rows; ++r) {
      values.clear();
      for (std::int64_t s = part.num_sections - 1; s >= 0; --s) append_row(s, r);
      file_.write_rows(part.first_row + r, first, part.num_sections, values);
    }
  }

 private:
  io::MrcWriter& file_;
  const OrientedBox& box_;
  VolumeAxes axes_;
  float scale_;
};

}  // namespace

io::MrcMode mrc_mode(VoxelType type) {
  switch (type) {
    case VoxelType::kFloat32:
      return io::MrcMode::kFloat32;
    case VoxelType::kFloat16:
      return io::MrcMode::kFloat16;
    case VoxelType::kInt16:
      return io::MrcMode::kInt16;
  }
  return io::MrcMode::kFloat32;
}

constexpr std::string_view kStored = ", stored = ";  // in the label of a volume of integers

double int16_factor(double largest_value, std::string& label) {
  constexpr double kLargestStored = 32000.0;
  const double largest = std::abs(largest_value);
  const double factor = largest > 0 ? kLargestStored / largest : 1.0;
  label += fmt::format("{}{:.6g} x value", kStored, factor);
  return factor;
}

double stored_factor(const io::MrcHeader& header) {
  for (const std::string& label : header.labels) {
    const std::size_t at = label.find(kStored);
    if (at == std::string::npos) continue;
    const std::string number = label.substr(at + kStored.size());
    const auto factor = io::parse_number(number.substr(0, number.find(' ')));
    return factor ? double{*factor} : 1.0;
  }
  return 1.0;
}

std::vector<std::string> faults_of(const VolumeOptions& options) {
  if (options.zarr || options.zarr_version == VolumeOptions{}.zarr_version) return {};
  return {"--zarr-version says how --zarr writes the volume: give --zarr as well"};
}

std::filesystem::path zarr_path(const std::filesystem::path& volume) {
  std::filesystem::path path = volume;
  return path.replace_extension(".zarr");
}

namespace {

// Throws Error unless the disk has room for a volume and for its OME-Zarr, which ends in whole
// chunks: many more bytes than a thin volume has itself.
void require_room_for_both(const std::filesystem::path& path, const io::MrcSpec& spec) {
  const base::CheckedSize zarr = io::ome_zarr_bytes({spec.nx, spec.ny, spec.nz}, spec.mode);
  const base::CheckedSize volume =
      base::CheckedSize(spec.nx) * spec.ny * spec.nz * io::bytes_per_value(spec.mode);
  const auto bytes = (volume + zarr).find();
  if (!bytes) throw Error(fmt::format("cannot write '{}': no disk has room for it", path.string()));
  io::require_room(io::folder_of(path), zarr_path(path), *bytes);
}

void warn_of_old_zarr(const std::filesystem::path& volume) {
  const std::filesystem::path zarr = zarr_path(volume);
  std::error_code absent;
  if (!std::filesystem::exists(zarr / io::kZarrMarker, absent)) return;
  base::log_warning(
      fmt::format("'{}' stays as it is, and is not of the new '{}': remove it, or give --zarr",
                  zarr.string(), volume.string()));
}

}  // namespace

void write_zarr(const std::filesystem::path& volume, ZarrVersion version) {
  const base::TraceSpan span("write OME-Zarr");
  const io::OutputSet* const results = io::OutputSet::active();
  io::write_ome_zarr(results != nullptr ? results->location_of(volume) : volume, zarr_path(volume),
                     volume.stem().string(), version);
}

void check_zarr(const std::filesystem::path& volume,
                const std::vector<std::filesystem::path>& inputs, bool may_replace,
                const std::string& advice) {
  const std::filesystem::path zarr = zarr_path(volume);
  io::require_no_input_is_replaced({zarr}, inputs);
  io::require_replaceable_zarr(zarr);
  if (!may_replace && std::filesystem::exists(zarr))
    throw Error(fmt::format("'{}' exists: {}", zarr.string(), advice));
}

OrientedBox tomogram_box(const ModelInfo& model, double voxel_px) {
  const auto& roi = model.roi;
  return field::box_between(
      {static_cast<double>(roi.x0), static_cast<double>(roi.y0), 0.0},
      {static_cast<double>(roi.x1), static_cast<double>(roi.y1), model.geometry.thickness},
      voxel_px);
}

OrientedBox region_box(const ModelInfo& model, double voxel_px, const Levelling& levelling) {
  return VolumeFrame(model, levelling).to_field(tomogram_box(model, voxel_px));
}

float largest_density(const Model& model) {
  const OrientedBox box = region_box(model, 1.0);
  return largest_density([&](const field::BoxSink& sink) { sample_box(model, box, sink); },
                         distributed::Communicator::alone());
}

void write_volume(const Model& model, const VolumeOptions& options,
                  const std::filesystem::path& path, const VolumePart& part) {
  const OrientedBox box = part.box.value_or(region_box(model, 1.0));
  field::require_feasible(box);
  require_inside(model, BoxBounds(box));
  const bool is_integer = options.voxel_type == VoxelType::kInt16;
  const std::size_t passes = is_integer && !part.largest_density ? 2 : 1;
  bool is_announced = !part.box;  // an export is, once its file can be written
  const auto source = [&](const field::BoxSink& sink) {
    if (!std::exchange(is_announced, true)) announce_sampling(model, std::vector(passes, box));
    sample_box(model, box, sink);
  };
  write_voxels(source, box, model, kMadeBy, options, path, distributed::Communicator::alone(),
               part.largest_density);
}

void write_volume(Model& model, const VolumeOptions& options, const std::filesystem::path& path,
                  const VolumeShare& share) {
  const OrientedBox box = region_box(model, 1.0);
  if (share.processes.size() == 1) return write_volume(model, options, path);
  if (box.is_aligned()) {
    const auto source = [&](const field::BoxSink& sink) {
      sample_box(*model.field, box, share.rows, sink);
    };
    return write_voxels(source, box, model, kMadeBy, options, path, share.processes);
  }
  gather_parameters(share, *model.field);
  share.processes.run_collectively([&] {
    if (share.processes.is_root()) write_volume(model, options, path);
  });
}

void write_voxels(const VoxelSource& source, const OrientedBox& box, const ModelInfo& info,
                  const std::string& made_by, const VolumeOptions& options,
                  const std::filesystem::path& path, const distributed::Communicator& processes,
                  std::optional<float> largest) {
  const base::TraceSpan span("write volume");
  io::MrcSpec spec;
  spec.nx = box.size[0];
  spec.ny = box.size[1];
  spec.nz = box.size[2];
  if (options.axes == VolumeAxes::kXzy) std::swap(spec.ny, spec.nz);
  spec.mode = mrc_mode(options.voxel_type);
  spec.voxel_size_A.fill(box.voxel_px * info.pixel_size_A);
  const OrientedBox in_volume = VolumeFrame(info).from_field(box);
  spec.origin_A = corner_A(info, in_volume, options.axes);
  spec.labels = volume_labels(info, made_by);
  if (!in_volume.is_aligned()) spec.labels.emplace_back(io::kLabelOfTurnedBox);
  if (info.x_tilt_deg != 0.0) spec.labels.emplace_back(io::kLabelOfXTilt);

  if (options.zarr) processes.run_collectively([&] { require_room_for_both(path, spec); });

  double scale = options.invert ? -info.output_scale() : info.output_scale();
  if (options.voxel_type == VoxelType::kInt16) {
    { const io::MrcWriter probe(path, spec, processes); }  // refuses before the pass, not after it
    const double factor = int16_factor(
        scale * static_cast<double>(largest ? *largest : largest_density(source, processes)),
        spec.labels.front());
    scale *= factor;
  }
  io::MrcWriter file(path, spec, processes);
  processes.run_collectively([&] { source(PartWriter(file, box, options.axes, scale)); });
  file.close();
  if (!options.zarr) return warn_of_old_zarr(path);
  processes.run_collectively([&] {
    if (processes.is_root()) write_zarr(path, options.zarr_version);
  });
}

}  // namespace tomofield::output
