#include <fmt/format.h>

#include <filesystem>
#include <span>
#include <vector>

#include "base/plausible.h"
#include "base/system/memory.h"
#include "io/images/mrc.h"
#include "io/saving/output_files.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "output/public_model.h"
#include "output/volume.h"
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

}  // namespace

void export_volume(const Model& model, const SampleBox& box, const VolumeFile& file) {
  const std::vector<io::OutputLock> locks = claim(file.path, file.overwrite);
  if (file.options.zarr) output::check_zarr(file.path, file.overwrite, kAdvice);
  io::OutputSet results;
  output::write_volume(ModelAccess::model(model), file.options, file.path,
                       {.box = oriented_box(box)});
  results.commit();
}

Tomogram read_mrc(const std::filesystem::path& path) {
  const io::MrcReader file(path);
  const io::MrcHeader& header = file.header();
  const auto section = static_cast<std::size_t>(header.nx * header.ny);
  const std::size_t count = section * static_cast<std::size_t>(header.nz);
  base::require_memory(count * sizeof(float), fmt::format("'{}' in memory", path.string()).c_str(),
                       "export a part of it, or with larger voxels");
  Tomogram volume{.size = {header.nx, header.ny, header.nz},
                  .voxel_size_A = header.voxel_size_A[0],
                  .values = std::vector<float>(count)};
  for (std::int64_t z = 0; z < header.nz; ++z)
    file.read_section(
        z, std::span(volume.values).subspan(static_cast<std::size_t>(z) * section, section));
  return volume;
}

void write_mrc(const Tomogram& volume, const std::filesystem::path& path, bool overwrite) {
  const auto [nx, ny, nz] = volume.size;
  if (!base::is_plausible_pixel_size(volume.voxel_size_A))
    throw Error(fmt::format("voxels of {} Å cannot be written: give their size, from {} to {} Å",
                            volume.voxel_size_A, base::kPixelSizes_A.low(),
                            base::kPixelSizes_A.high()));
  if (nx < 1 || ny < 1 || nz < 1 || !(base::CheckedSize(nx) * ny * nz).is(volume.values.size()))
    throw Error(fmt::format("{} values are not a volume of {} × {} × {} voxels",
                            volume.values.size(), nx, ny, nz));
  const std::vector<io::OutputLock> locks = claim(path, overwrite);
  io::MrcSpec spec;
  spec.nx = nx;
  spec.ny = ny;
  spec.nz = nz;
  spec.voxel_size_A.fill(volume.voxel_size_A);
  // A label that began with "tomofield" would say that the file is no tilt series.
  spec.labels = {fmt::format("values in memory, written by tomofield {}", library_version())};
  io::MrcWriter file(path, spec);
  file.write_sections(0, volume.values);
  file.close();
}

}  // namespace tomofield
