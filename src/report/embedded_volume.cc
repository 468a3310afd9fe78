#include "report/embedded_volume.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/threads/parallel.h"
#include "io/images/jpeg.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "report/contrast.h"
#include "report/page_picture.h"
#include "report/reduced_volume.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kMostVoxels = 40'000'000;
constexpr std::int64_t kSheetSide_px = 4096;  // every browser has canvases of this size
constexpr std::int64_t kBlock_px = 8;         // of JPEG: no block has pixels of two sections
constexpr int kQualities[] = {82, 65, 48, 32, 18, 8};

std::int64_t whole_blocks(std::int64_t side) {
  return (side + kBlock_px - 1) / kBlock_px * kBlock_px;
}

void choose_limits(const Contrast& contrast, EmbeddedVolume& volume) {
  const double beyond = (contrast.white - contrast.black) / 2;
  volume.contrast = {contrast.black, contrast.white};
  volume.limits = {contrast.black - beyond, contrast.white + beyond};
}

void arrange_sheets(EmbeddedVolume& volume) {
  volume.tile = {whole_blocks(volume.size[0]), whole_blocks(volume.size[1])};
  volume.columns = std::clamp<std::int64_t>(kSheetSide_px / volume.tile[0], 1, volume.size[2]);
  const std::int64_t needed = (volume.size[2] + volume.columns - 1) / volume.columns;
  volume.rows = std::clamp<std::int64_t>(kSheetSide_px / volume.tile[1], 1, needed);
}

// The voxels of the reduced volume, [z, y, x].
using Bytes = std::vector<std::uint8_t>;

Bytes reduced_bytes(const io::MrcReader& mrc, const EmbeddedVolume& volume) {
  const double low = volume.limits.first, scale = 255.0 / (volume.limits.second - low);
  const auto area = static_cast<std::size_t>(volume.size[0] * volume.size[1]);
  Bytes bytes(area * static_cast<std::size_t>(volume.size[2]));
  reduce_volume(mrc, volume.size, [&](std::int64_t section, std::span<const float> values) {
    std::uint8_t* out = &bytes[static_cast<std::size_t>(section) * area];
    for (const float value : values)
      *out++ = static_cast<std::uint8_t>(
          std::lround(std::clamp((static_cast<double>(value) - low) * scale, 0.0, 255.0)));
  });
  return bytes;
}

// Copies a section into its place in a sheet. The first row of a section is at the bottom of its
// tile. Pixels of the tile beyond the section repeat its edge, which JPEG stores best.
void place_section(const Bytes& bytes, const EmbeddedVolume& volume, std::int64_t section,
                   std::int64_t place, Bytes& sheet) {
  const auto [nx, ny, nz] = volume.size;
  const auto [width, height] = volume.tile;
  const std::int64_t sheet_width = width * volume.columns;
  const std::uint8_t* values = bytes.data() + section * nx * ny;
  std::uint8_t* corner =
      sheet.data() + place / volume.columns * height * sheet_width + place % volume.columns * width;
  for (std::int64_t row = 0; row < height; ++row) {
    const std::uint8_t* from = values + std::max<std::int64_t>(ny - 1 - row, 0) * nx;
    std::uint8_t* to = corner + row * sheet_width;
    std::copy_n(from, nx, to);
    std::fill(to + nx, to + width, from[nx - 1]);
  }
}

std::vector<std::string> encode_sheets(const Bytes& bytes, const EmbeddedVolume& volume,
                                       int quality) {
  const std::int64_t sections = volume.size[2], of_sheet = volume.columns * volume.rows;
  const std::int64_t width = volume.tile[0] * volume.columns;
  std::vector<std::string> sheets(static_cast<std::size_t>((sections + of_sheet - 1) / of_sheet));
  base::parallel_for("encode sheets", std::ssize(sheets), [&](std::int64_t i) {
    const std::int64_t first = i * of_sheet, count = std::min(of_sheet, sections - first);
    const std::int64_t height =
        (count + volume.columns - 1) / volume.columns * volume.tile[1];  // the last may be lower
    Bytes sheet(static_cast<std::size_t>(width * height));
    for (std::int64_t place = 0; place < count; ++place)
      place_section(bytes, volume, first + place, place, sheet);
    sheets[static_cast<std::size_t>(i)] = io::jpeg_grey(width, height, sheet, quality);
  });
  return sheets;
}

std::size_t total_size(const std::vector<std::string>& sheets) {
  std::size_t bytes = 0;
  for (const std::string& sheet : sheets) bytes += sheet.size();
  return bytes;
}

}  // namespace

EmbeddedVolume embed_volume(const std::filesystem::path& mrc) {
  const io::MrcReader file(mrc);
  const io::MrcHeader& header = file.header();
  EmbeddedVolume volume;
  volume.size = reduced_size(header, kMostVoxels);
  volume.file_size = {header.nx, header.ny, header.nz};
  volume.voxel_size_A = io::cubic_voxel_size_A(header, mrc);
  choose_limits(contrast_of(file), volume);
  arrange_sheets(volume);
  const Bytes bytes = reduced_bytes(file, volume);
  for (const int quality : kQualities) {
    volume.sheets = encode_sheets(bytes, volume, quality);
    if (total_size(volume.sheets) <= kMostSheetBytes) break;
  }
  return volume;
}

}  // namespace tomofield::report
