#include "io/images/zarr_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "base/check.h"
#include "io/images/mrc_format.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

const char* type_name(MrcMode mode) {
  return mode == MrcMode::kInt16 ? "<i2" : mode == MrcMode::kFloat16 ? "<f2" : "<f4";
}

void make_folders(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed)
    throw Error(fmt::format("cannot make the folder '{}': {}", folder.string(), failed.message()));
}

void write_file(const fs::path& path, std::span<const std::byte> bytes) {
  PositionedFile file(path, PositionedFile::Access::kNew);
  file.write_at(0, bytes.data(), bytes.size());
  file.close();
}

}  // namespace

ZarrArray::ZarrArray(const fs::path& folder, const std::array<std::int64_t, 3>& size, MrcMode mode)
    : folder_(folder), size_(size), mode_(mode) {
  make_folders(folder);
  const nlohmann::json description{{"zarr_format", 2},
                                   {"shape", {size[2], size[1], size[0]}},
                                   {"chunks", {kSide, kSide, kSide}},
                                   {"dtype", type_name(mode)},
                                   {"compressor", nullptr},
                                   {"fill_value", 0},
                                   {"order", "C"},
                                   {"filters", nullptr},
                                   {"dimension_separator", "/"}};
  const std::string text = description.dump(2);
  write_file(folder / ".zarray", std::as_bytes(std::span(text)));
}

fs::path ZarrArray::chunk_path(std::int64_t z, std::int64_t y, std::int64_t x) const {
  return folder_ / std::to_string(z) / std::to_string(y) / std::to_string(x);
}

void ZarrArray::write_chunks(std::int64_t chunk_z, std::int64_t chunk_y,
                             std::span<float> values) const {
  const std::int64_t nx = size_[0];
  const std::int64_t rows = std::min(kSide, size_[1] - chunk_y * kSide);
  const std::int64_t sections = std::min(kSide, size_[2] - chunk_z * kSide);
  TOMOFIELD_CHECK(std::ssize(values) == sections * rows * nx, "the values must fill the chunks");
  make_folders(chunk_path(chunk_z, chunk_y, 0).parent_path());
  std::vector<float> chunk(static_cast<std::size_t>(kSide * kSide * kSide)), stored(chunk.size());
  std::vector<std::byte> raw(chunk.size() * bytes_per_value(mode_));
  for (std::int64_t x = 0; x < num_chunks(0); ++x) {
    const std::int64_t width = std::min(kSide, nx - x * kSide);
    // Calls copy(row of the array, row of the chunk) for each row that both have.
    const auto for_rows = [&](std::span<float> of_chunk, const auto& copy) {
      for (std::int64_t z = 0; z < sections; ++z) {
        for (std::int64_t y = 0; y < rows; ++y)
          copy(values.data() + (z * rows + y) * nx + x * kSide,
               of_chunk.data() + (z * kSide + y) * kSide);
      }
    };
    std::ranges::fill(chunk, 0.0f);
    for_rows(chunk, [&](const float* row, float* to) { std::copy_n(row, width, to); });
    encode_values(mode_, chunk, raw, stored);
    for_rows(stored, [&](float* row, const float* from) { std::copy_n(from, width, row); });
    write_file(chunk_path(chunk_z, chunk_y, x), raw);
  }
}

void ZarrArray::read_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                          std::span<float> out) const {
  MrcHeader native;
  native.mode = mode_;
  const std::int64_t bytes = static_cast<std::int64_t>(bytes_per_value(mode_));
  std::vector<float> rows(static_cast<std::size_t>(kSide * kSide));
  std::vector<std::byte> raw(rows.size() * bytes_per_value(mode_));
  for (std::int64_t row = first_row; row < first_row + num_rows;) {
    const std::int64_t in_chunk = row % kSide;
    const std::int64_t count = std::min(kSide - in_chunk, first_row + num_rows - row);
    const auto part = static_cast<std::size_t>(count * kSide);
    for (std::int64_t x = 0; x < num_chunks(0); ++x) {
      const PositionedFile file(chunk_path(section / kSide, row / kSide, x),
                                PositionedFile::Access::kRead);
      const std::int64_t first = ((section % kSide) * kSide + in_chunk) * kSide;
      const auto raw_part = std::span(raw).first(part * bytes_per_value(mode_));
      file.read_at(first * bytes, raw_part.data(), raw_part.size());
      decode_values(native, raw_part, std::span(rows).first(part));
      const std::int64_t width = std::min(kSide, size_[0] - x * kSide);
      for (std::int64_t y = 0; y < count; ++y)
        std::copy_n(rows.data() + y * kSide, width,
                    out.data() + (row - first_row + y) * size_[0] + x * kSide);
    }
    row += count;
  }
}

}  // namespace tomofield::io
