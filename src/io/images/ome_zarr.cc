#include "io/images/ome_zarr.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/progress.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/images/zarr_array.h"
#include "io/images/zarr_store.h"
#include "io/saving/atomic_folder.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"
#include "tomofield/version.h"

namespace tomofield::io {
namespace {

using Size = std::array<std::int64_t, 3>;  // x, y, z

// Calls write(chunk z, chunk y, buffer) for all chunks of an array that lie beside each other in
// x.
template <typename Write>
void for_chunks(const ZarrArray& array, const Write& write) {
  std::vector<float> values;
  for (std::int64_t z = 0; z < array.num_chunks(2); ++z) {
    const std::int64_t sections =
        std::min(ZarrArray::kSide, array.size()[2] - z * ZarrArray::kSide);
    for (std::int64_t y = 0; y < array.num_chunks(1); ++y) {
      base::allow_interruption();
      const std::int64_t rows = std::min(ZarrArray::kSide, array.size()[1] - y * ZarrArray::kSide);
      values.assign(static_cast<std::size_t>(sections * rows * array.size()[0]), 0.0f);
      write(z, y, sections, rows, values);
      array.write_chunks(z, y, values);
    }
  }
}

void copy_volume(const MrcReader& volume, const ZarrArray& array) {
  for_chunks(array, [&](std::int64_t z, std::int64_t y, std::int64_t sections, std::int64_t rows,
                        std::span<float> values) {
    const auto part = static_cast<std::size_t>(rows * array.size()[0]);
    for (std::int64_t s = 0; s < sections; ++s)
      volume.read_rows(z * ZarrArray::kSide + s, y * ZarrArray::kSide, rows,
                       values.subspan(static_cast<std::size_t>(s) * part, part));
  });
}

// Adds pairs of rows of one section of the finer array to the rows of a coarser one.
void add_halved(std::span<const float> fine, std::int64_t fine_width, std::int64_t fine_rows,
                std::int64_t width, std::span<float> sums) {
  for (std::int64_t y = 0; y < fine_rows; ++y) {
    const float* from = fine.data() + y * fine_width;
    float* to = sums.data() + (y / 2) * width;
    for (std::int64_t x = 0; x < fine_width; ++x) to[x / 2] += from[x];
  }
}

// Divides sums by the number of voxels that they are of, which is smaller at odd ends.
void divide_by_counts(const Size& fine, std::int64_t section, std::int64_t first_row,
                      std::int64_t width, std::span<float> sums) {
  const auto pair = [](std::int64_t index, std::int64_t size) {
    return static_cast<float>(std::min<std::int64_t>(2, size - 2 * index));
  };
  const std::int64_t rows = std::ssize(sums) / width;
  for (std::int64_t y = 0; y < rows; ++y) {
    const float outer = pair(section, fine[2]) * pair(first_row + y, fine[1]);
    for (std::int64_t x = 0; x < width; ++x)
      sums[static_cast<std::size_t>(y * width + x)] /= outer * pair(x, fine[0]);
  }
}

void average_pairs(const ZarrArray& finer, const ZarrArray& array) {
  const Size& fine = finer.size();
  const std::int64_t width = array.size()[0];
  std::vector<float> read(static_cast<std::size_t>(2 * ZarrArray::kSide * fine[0]));
  for_chunks(array, [&](std::int64_t z, std::int64_t y, std::int64_t sections, std::int64_t rows,
                        std::span<float> values) {
    const std::int64_t first_row = y * ZarrArray::kSide;
    const std::int64_t fine_rows = std::min(2 * rows, fine[1] - 2 * first_row);
    const auto part = static_cast<std::size_t>(rows * width);
    for (std::int64_t s = 0; s < sections; ++s) {
      const std::int64_t section = z * ZarrArray::kSide + s;
      const auto sums = values.subspan(static_cast<std::size_t>(s) * part, part);
      for (std::int64_t f = 2 * section; f < std::min(2 * section + 2, fine[2]); ++f) {
        finer.read_rows(f, 2 * first_row, fine_rows, read);
        add_halved(read, fine[0], fine_rows, width, sums);
      }
      divide_by_counts(fine, section, first_row, width, sums);
    }
  });
}

Size halved(Size size) {
  for (std::int64_t& side : size) side = (side + 1) / 2;
  return size;
}

// Describes one array: the side of its voxels, and the middle of its first voxel as that of array
// "0" has it, which is at the ORIGIN.
nlohmann::json dataset(int level, const MrcHeader& volume) {
  const double factor = static_cast<double>(std::int64_t{1} << level);
  nlohmann::json scale = nlohmann::json::array(), translation = nlohmann::json::array();
  for (const std::size_t axis : {2, 1, 0}) {
    const double voxel_A = volume.voxel_size_A[axis];
    scale.push_back(factor * voxel_A);
    translation.push_back(volume.origin_A[axis] + (factor - 1) / 2 * voxel_A);
  }
  return {{"path", std::to_string(level)},
          {"coordinateTransformations",
           {{{"type", "scale"}, {"scale", scale}},
            {{"type", "translation"}, {"translation", translation}}}}};
}

// Describes the volume and its levels. In 0.5 the version stands beside this.
nlohmann::json multiscale(const std::string& name, const MrcHeader& volume, int num_levels) {
  nlohmann::json axes = nlohmann::json::array(), datasets = nlohmann::json::array();
  for (const char* axis : {"z", "y", "x"})
    axes.push_back({{"name", axis}, {"type", "space"}, {"unit", "angstrom"}});
  for (int level = 0; level < num_levels; ++level) datasets.push_back(dataset(level, volume));
  return {{"name", name},
          {"axes", axes},
          {"datasets", datasets},
          {"type", "mean"},
          {"metadata", {{"tomofield", library_version()}, {"labels", volume.labels}}}};
}

void write_text(const std::filesystem::path& path, const nlohmann::json& json) {
  const std::string text = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
  PositionedFile file(path, PositionedFile::Access::kNew);
  file.write_at(0, text.data(), text.size());
  file.close();
}

void write_group(const std::filesystem::path& root, nlohmann::json scales, ZarrVersion version) {
  if (version == ZarrVersion::k05) {
    const nlohmann::json ome{{"version", "0.5"}, {"multiscales", {scales}}};
    write_text(root / "zarr.json",
               {{"zarr_format", 3}, {"node_type", "group"}, {"attributes", {{"ome", ome}}}});
    return;
  }
  scales["version"] = "0.4";
  write_text(root / ".zattrs", {{"multiscales", {scales}}});
  write_text(root / ".zgroup", {{"zarr_format", 2}});
}

}  // namespace

base::CheckedSize ome_zarr_bytes(Size size, MrcMode mode) {
  base::CheckedSize bytes(0);
  for (;; size = halved(size)) {
    base::CheckedSize of_level(static_cast<std::int64_t>(bytes_per_value(mode)));
    for (const std::int64_t side : size)
      of_level = of_level * ((side + ZarrArray::kSide - 1) / ZarrArray::kSide * ZarrArray::kSide);
    bytes = bytes + of_level;
    if (std::ranges::max(size) <= ZarrArray::kSide) return bytes;
  }
}

void write_ome_zarr(const std::filesystem::path& mrc, const std::filesystem::path& zarr,
                    const std::string& name, ZarrVersion version) {
  require_replaceable_zarr(zarr);
  const MrcReader volume(mrc);
  const MrcHeader& header = volume.header();
  AtomicFolder folder(zarr, kZarrMarker);
  const std::filesystem::path root = folder.temporary_path();
  std::vector<ZarrArray> arrays;
  arrays.emplace_back(root / "0", Size{header.nx, header.ny, header.nz}, header.mode, version);
  copy_volume(volume, arrays.back());
  while (std::ranges::max(arrays.back().size()) > ZarrArray::kSide) {
    ZarrArray coarser(root / std::to_string(arrays.size()), halved(arrays.back().size()),
                      header.mode, version);
    average_pairs(arrays.back(), coarser);
    arrays.push_back(std::move(coarser));
  }
  write_group(root, multiscale(name, header, static_cast<int>(arrays.size())), version);
  write_text(root / kZarrMarker, {{"made_by", library_version()}});
  folder.commit();
}

}  // namespace tomofield::io
