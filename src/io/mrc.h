#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "distributed/communicator.h"

namespace tomofield::io {

/// Storage modes of MRC2014 that tomofield reads and writes.
enum class MrcMode : std::int32_t {
  kInt8 = 0,
  kInt16 = 1,
  kFloat32 = 2,
  kUint16 = 6,
  kFloat16 = 12
};

/// What an MRC header says, in units that the program uses. Sections are the
/// file's slowest axis, x the fastest.
struct MrcHeader {
  std::int64_t nx = 0;
  std::int64_t ny = 0;
  std::int64_t nz = 0;
  MrcMode mode = MrcMode::kFloat32;
  std::array<double, 3> voxel_size_A{1.0, 1.0, 1.0};
  std::array<double, 3> origin_A{0.0, 0.0, 0.0};
  double min = 0.0, max = 0.0, mean = 0.0, rms = 0.0;
  bool is_volume = false;           ///< ISPG 1; 0 is a stack of images
  bool is_byte_swapped = false;     ///< written on a machine of the other byte order
  bool bytes_are_unsigned = false;  ///< mode 0 with IMOD's stamp and without its signed flag
  std::int64_t extended_header_bytes = 0;
  std::string extended_header_type;
  std::vector<double> extended_tilt_deg;  ///< from a SERI header under flag 1, else empty
  std::vector<std::string> labels;
};

/// Reads any part of an MRC file as float32 without holding more than the part.
/// Opening checks the header and that the file is as long as it says.
/// Thread-safe: reads are positioned.
class MrcReader {
 public:
  /// Throws Error for a missing, truncated (bytes expected and found) or hostile file.
  explicit MrcReader(const std::filesystem::path& path);
  ~MrcReader();
  MrcReader(MrcReader&&) noexcept;
  MrcReader& operator=(MrcReader&&) noexcept;

  const MrcHeader& header() const;
  const std::filesystem::path& path() const;

  /// Section `section` as ny × nx floats.
  void read_section(std::int64_t section, std::span<float> out) const;
  /// Rows [first_row, first_row + num_rows) of a section.
  void read_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                 std::span<float> out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What a new MRC file shall be.
struct MrcSpec {
  std::int64_t nx = 0;
  std::int64_t ny = 0;
  std::int64_t nz = 0;
  MrcMode mode = MrcMode::kFloat32;
  std::array<double, 3> voxel_size_A{1.0, 1.0, 1.0};
  std::array<double, 3> origin_A{0.0, 0.0, 0.0};
  bool is_volume = true;
  std::string label;  ///< how the file was made; at most 80 characters are kept
};

/// Writes an MRC file piece by piece into a temporary file beside `path`, and
/// puts it in place of `path` in close() alone, with true statistics in the
/// header. A writer that is destroyed before close() leaves `path` as it was
/// and removes its temporary file. Rows may come in any order, each once;
/// rows never written are zero. Writes from several threads are safe.
/// Integer modes round and saturate; int16/int8/uint16 values outside the range are clamped.
///
/// Several processes may write one file, each its rows; all of them make a writer and close it, and
/// the first puts the file in place.
class MrcWriter {
 public:
  MrcWriter(const std::filesystem::path& path, const MrcSpec& spec,
            const distributed::Communicator& processes = distributed::Communicator::alone());
  ~MrcWriter();
  MrcWriter(MrcWriter&&) noexcept;

  void write_section(std::int64_t section, std::span<const float> values);
  void write_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                  std::span<const float> values);
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tomofield::io
