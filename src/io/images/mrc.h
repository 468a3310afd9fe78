#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
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

/// The contents of an MRC header in the program's units. Sections are the file's slowest axis, x is
/// the fastest.
struct MrcHeader {
  std::int64_t nx = 0;
  std::int64_t ny = 0;
  std::int64_t nz = 0;
  MrcMode mode = MrcMode::kFloat32;
  std::array<double, 3> voxel_size_A{1.0, 1.0, 1.0};
  std::array<double, 3> origin_A{0.0, 0.0, 0.0};  ///< of a part in the whole, as MRC2014 has it
  double min = 0.0, max = 0.0, mean = 0.0, rms = 0.0;
  /// Sets the statistics to what MRC2014 has for "not determined".
  void leave_statistics_undetermined() { min = 0.0, max = -1.0, mean = -2.0, rms = -1.0; }
  bool is_volume = false;              ///< ISPG 1; 0 is a stack of images
  std::int64_t sections_a_volume = 0;  ///< written with ISPG 401: a stack of volumes; else 0
  bool is_byte_swapped = false;        ///< written on a machine of the other byte order
  bool bytes_are_unsigned = false;     ///< mode 0 with IMOD's stamp and without its signed flag
  std::int64_t extended_header_bytes = 0;
  std::string extended_header_type;
  std::vector<double> extended_tilt_deg;  ///< angles in the extended header, one a section, or none
  /// Direction of the tilt axis in the extended header, counter-clockwise from +Y.
  std::optional<double> extended_axis_deg;
  std::optional<double> extended_voltage_kV;  ///< of the microscope, in the extended header
  std::optional<double> extended_pixel_A;     ///< width of a pixel, in the extended header
  /// Says for messages what the header states twice and differently, or that cannot be: "pixels in
  /// Å of 7 in section 2, and of 3.5 in the first, which is taken".
  std::vector<std::string> differences;
  bool is_ctf_corrected = false;   ///< IMOD's flag of a stack that went through ctfphaseflip
  bool has_rows_from_top = false;  ///< for IMOD alone: FEI's files that it has not written again
  bool has_pieces = false;         ///< by the extended header: sections are the pieces of montages
  std::vector<std::string> labels;
};

/// Reads any part of an MRC file as float32 without holding more than that part. Thread-safe,
/// because reads are positioned.
class MrcReader {
 public:
  /// Checks the header and that the file is as long as it says. Throws Error for a missing,
  /// truncated (with the bytes expected and found) or hostile file.
  explicit MrcReader(const std::filesystem::path& path);
  ~MrcReader();
  MrcReader(MrcReader&&) noexcept;
  MrcReader& operator=(MrcReader&&) noexcept;

  const MrcHeader& header() const;
  const std::filesystem::path& path() const;

  /// Reads section `section` as ny × nx floats.
  void read_section(std::int64_t section, std::span<float> out) const;
  /// Reads rows [first_row, first_row + num_rows) of a section.
  void read_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                 std::span<float> out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The properties of a new MRC file.
struct MrcSpec {
  std::int64_t nx = 0;
  std::int64_t ny = 0;
  std::int64_t nz = 0;
  MrcMode mode = MrcMode::kFloat32;
  std::array<double, 3> voxel_size_A{1.0, 1.0, 1.0};
  std::array<double, 3> origin_A{0.0, 0.0, 0.0};  ///< of a part in the whole
  bool is_volume = true;
  std::int64_t sections_a_volume = 0;  ///< of each volume of a stack of volumes; 0: no such stack
  std::vector<std::string> labels;     ///< how it was made: at most 10, of 80 characters each
};

/// Writes an MRC file piece by piece into a temporary file beside `path`. Only close() replaces
/// `path`, with correct statistics in the header. A writer that is destroyed before close() leaves
/// `path` as it was and removes its temporary file. Rows may come in any order, each once; rows
/// that are never written are zero. Several threads may write. Integer modes round; int8, int16 and
/// uint16 clamp values outside their range.
///
/// Several ranks may write one file, each its own rows. All of them make a writer and close it; the
/// root puts the file in place.
class MrcWriter {
 public:
  MrcWriter(const std::filesystem::path& path, const MrcSpec& spec,
            const distributed::Communicator& processes = distributed::Communicator::alone());
  ~MrcWriter();
  MrcWriter(MrcWriter&&) noexcept;

  void write_section(std::int64_t section, std::span<const float> values);
  /// Writes consecutive sections from `first` on, as many as there are values for.
  void write_sections(std::int64_t first, std::span<const float> values);
  void write_rows(std::int64_t section, std::int64_t first_row, std::int64_t num_rows,
                  std::span<const float> values);
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Returns true for the header of a volume that this program has written, which is no tilt series.
inline bool is_own_volume(const MrcHeader& header) {
  return header.is_volume && std::ranges::any_of(header.labels, [](const std::string& label) {
           return label.starts_with("tomofield ");
         });
}

}  // namespace tomofield::io
