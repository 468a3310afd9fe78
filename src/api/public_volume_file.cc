#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <span>
#include <vector>

#include "base/near_whole.h"
#include "base/plausible.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "exchange/model_export.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/saving/output_files.h"
#include "io/saving/output_lock.h"
#include "output/public_model.h"
#include "output/volume_frame.h"
#include "tomofield/error.h"
#include "tomofield/version.h"
#include "tomofield/volume_file.h"

namespace tomofield {
namespace {

constexpr const char* kAdvice = "give another name, or overwrite to replace it";

// Checks that a volume can be written, and locks its file.
std::vector<io::OutputLock> claim(const std::filesystem::path& path, bool overwrite) {
  return io::claim_outputs({path}, [&] {
    io::check_output_files({path}, {}, overwrite, kAdvice);
    io::require_volume_name(path);
  });
}

bool is_finite(const std::array<double, 3>& origin_A) {
  return std::ranges::all_of(origin_A,
                             [](double at_A) { return std::isfinite(static_cast<float>(at_A)); });
}

exchange::ExportFiles files_of(const Model& model, const VolumeFile& file) {
  return {.output = file.path,
          .model = ModelAccess::file(model),
          .volume = file.options,
          .overwrite = file.overwrite};
}

}  // namespace

void export_volume(const Model& model, const VolumePlace& place, const VolumeFile& file) {
  const base::ThreadsInUse threads;
  if (place.box && place.level && place.box->euler_deg != SampleBox{}.euler_deg)
    throw Error("a box that has angles of its own cannot be levelled (--rotate, --level)");
  const exchange::ExportFiles files = files_of(model, file);
  const std::vector<io::OutputLock> locks = exchange::claim_export(files, kAdvice);
  require_usable_voxels(place.voxel_px);
  exchange::ExportPlace placed{.voxel_px = base::whole_if_near(place.voxel_px),
                               .level = place.level};
  if (place.box) placed.box = oriented_box(*place.box);
  const output::Model& field = ModelAccess::model(model);
  exchange::export_volume(field, exchange::box_in_field(field, placed), files);
}

Levelling found_levelling(const Model& model) {
  const std::filesystem::path& file = ModelAccess::file(model);
  if (file.empty())
    throw Error(
        "a model in memory has no alignment beside it to level it by: give both angles in degrees "
        "(--level PITCH,X_TILT)");
  return output::found_levelling(ModelAccess::model(model), file);
}

CutParticles export_particles(const Model& model, const ParticleCuts& cuts,
                              const VolumeFile& file) {
  const base::ThreadsInUse threads;
  exchange::ExportFiles files = files_of(model, file);
  files.particles = cuts.list;
  const std::vector<io::OutputLock> locks = exchange::claim_export(files, kAdvice);
  require_usable_voxels(cuts.voxel_px);
  return exchange::export_particles(ModelAccess::model(model),
                                    {.size = cuts.size,
                                     .voxel_px = base::whole_if_near(cuts.voxel_px),
                                     .levelling = cuts.level.value_or(Levelling{})},
                                    cuts.tomogram, files);
}

Tomogram read_mrc(const std::filesystem::path& path) {
  const base::ThreadsInUse threads;
  const io::MrcReader file(path);
  const io::MrcHeader& header = file.header();
  const auto section = static_cast<std::size_t>(header.nx * header.ny);
  const std::size_t count = section * static_cast<std::size_t>(header.nz);
  base::require_memory(count * sizeof(float), fmt::format("'{}' in memory", path.string()).c_str(),
                       "export a part of it, or with larger voxels");
  Tomogram volume{
      .size = {header.nx, header.ny, header.nz},
      .voxel_size_A = io::cubic_voxel_size_A(header, path),
      .origin_A = is_finite(header.origin_A) ? header.origin_A : std::array<double, 3>{},
      .values = std::vector<float>(count)};
  io::warn_of_mode(header, path.string());
  for (std::int64_t z = 0; z < header.nz; ++z)
    file.read_section(
        z, std::span(volume.values).subspan(static_cast<std::size_t>(z) * section, section));
  return volume;
}

void write_mrc(const Tomogram& volume, const std::filesystem::path& path, bool overwrite) {
  const base::ThreadsInUse threads;
  const auto [nx, ny, nz] = volume.size;
  if (!base::is_plausible_pixel_size(volume.voxel_size_A))
    throw Error(fmt::format("voxels of {} Å cannot be written: give their size, from {} to {} Å",
                            volume.voxel_size_A, base::kPixelSizes_A.low(),
                            base::kPixelSizes_A.high()));
  if (nx < 1 || ny < 1 || nz < 1 || !(base::CheckedSize(nx) * ny * nz).is(volume.values.size()))
    throw Error(fmt::format("{} values are not a volume of {} × {} × {} voxels",
                            volume.values.size(), nx, ny, nz));
  if (!is_finite(volume.origin_A))
    throw Error("the origin of a volume is three finite numbers in Å");
  const std::vector<io::OutputLock> locks = claim(path, overwrite);
  io::MrcSpec spec;
  spec.nx = nx;
  spec.ny = ny;
  spec.nz = nz;
  spec.voxel_size_A.fill(volume.voxel_size_A);
  spec.origin_A = volume.origin_A;
  // A label that began with "tomofield" would say that the file is no tilt series.
  spec.labels = {fmt::format("values in memory, written by tomofield {}", library_version())};
  io::MrcWriter file(path, spec);
  file.write_sections(0, volume.values);
  file.close();
}

}  // namespace tomofield
