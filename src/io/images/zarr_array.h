#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include "io/images/mrc.h"
#include "tomofield/options.h"

namespace tomofield::io {

/// An array of a Zarr group, in a folder: [z, y, x] in uncompressed chunks of kSide voxels a side.
/// Each is a file "z/y/x", or "c/z/y/x" in a group of version 3. Chunks at the ends are filled up
/// with zeros.
class ZarrArray {
 public:
  static constexpr std::int64_t kSide = 64;

  /// Makes the folder with its description. `size` is (x, y, z).
  ZarrArray(const std::filesystem::path& folder, const std::array<std::int64_t, 3>& size,
            MrcMode mode, ZarrVersion version);

  const std::array<std::int64_t, 3>& size() const { return size_; }
  /// Returns the number of chunks along an axis (0: x).
  std::int64_t num_chunks(std::size_t axis) const { return (size_[axis] + kSide - 1) / kSide; }

  /// Writes the chunks at (chunk_z, chunk_y) for all x. `values` has the rows [z, y, x] that the
  /// array has there, and gets the values that a reader will find.
  void write_chunks(std::int64_t chunk_z, std::int64_t chunk_y, std::span<float> values) const;
  /// Reads rows of a section that has been written.
  void read_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                 std::span<float> out) const;

 private:
  std::filesystem::path chunk_path(std::int64_t z, std::int64_t y, std::int64_t x) const;

  std::filesystem::path chunks_;  // the folder of their files
  std::array<std::int64_t, 3> size_;
  MrcMode mode_;
};

}  // namespace tomofield::io
