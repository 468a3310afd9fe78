#include "io/images/zarr_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/check.h"
#include "io/images/mrc_format.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

const char* pick(MrcMode mode, const char* of_int16, const char* of_float16,
                 const char* of_float32) {
  return mode == MrcMode::kInt16 ? of_int16 : mode == MrcMode::kFloat16 ? of_float16 : of_float32;
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

nlohmann::json description_2(const nlohmann::json& shape, const nlohmann::json& chunk,
                             MrcMode mode) {
  return {{"zarr_format", 2},
          {"shape", shape},
          {"chunks", chunk},
          {"dtype", pick(mode, "<i2", "<f2", "<f4")},
          {"compressor", nullptr},
          {"fill_value", 0},
          {"order", "C"},
          {"filters", nullptr},
          {"dimension_separator", "/"}};
}

// https://zarr-specs.readthedocs.io, "Zarr core specification (version 3)".
nlohmann::json description_3(const nlohmann::json& shape, const nlohmann::json& chunk,
                             MrcMode mode) {
  const auto named = [](const char* name, nlohmann::json configuration) {
    return nlohmann::json{{"name", name}, {"configuration", std::move(configuration)}};
  };
  const nlohmann::json bytes = named("bytes", {{"endian", "little"}});
  return {{"zarr_format", 3},
          {"node_type", "array"},
          {"shape", shape},
          {"data_type", pick(mode, "int16", "float16", "float32")},
          {"chunk_grid", named("regular", {{"chunk_shape", chunk}})},
          {"chunk_key_encoding", named("default", {{"separator", "/"}})},
          {"codecs", nlohmann::json::array({bytes})},
          {"fill_value", mode == MrcMode::kInt16 ? nlohmann::json(0) : nlohmann::json(0.0)},
          {"dimension_names", {"z", "y", "x"}}};
}

}  // namespace

ZarrArray::ZarrArray(const fs::path& folder, const std::array<std::int64_t, 3>& size, MrcMode mode,
                     ZarrVersion version)
    : chunks_(version == ZarrVersion::k05 ? folder / "c" : folder), size_(size), mode_(mode) {
  make_folders(folder);
  const nlohmann::json shape{size[2], size[1], size[0]}, chunk{kSide, kSide, kSide};
  const bool is_3 = version == ZarrVersion::k05;
  const std::string text =
      (is_3 ? description_3(shape, chunk, mode) : description_2(shape, chunk, mode)).dump(2);
  write_file(folder / (is_3 ? "zarr.json" : ".zarray"), std::as_bytes(std::span(text)));
}

fs::path ZarrArray::chunk_path(std::int64_t z, std::int64_t y, std::int64_t x) const {
  return chunks_ / std::to_string(z) / std::to_string(y) / std::to_string(x);
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
