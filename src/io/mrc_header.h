#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "io/mrc.h"

namespace tomofield::io {

/// Bytes of the fixed part of an MRC2014 header; the extended header follows,
/// then the data.
inline constexpr std::size_t kMrcHeaderBytes = 1024;
using MrcHeaderBytes = std::array<std::byte, kMrcHeaderBytes>;

std::size_t bytes_per_value(MrcMode mode);

/// "float32 (mode 2)" and the like.
std::string describe(MrcMode mode);

/// Where the extended header keeps a tilt angle for each section, if it does.
struct SeriLayout {
  std::int64_t bytes_per_section = 0;  ///< 0: no angles
};

/// Reads the fixed header; `name` stands for the file in errors. Throws Error
/// for sizes that are not positive or overflow, unknown modes, a negative
/// extended header, and axes that are not in x, y, z order.
MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes, const std::string& name, SeriLayout* seri);

/// Bytes that a file with this header has; Error if 63 bits cannot hold them.
std::int64_t expected_file_bytes(const MrcHeader& header, const std::string& name);

/// Tilt angles in degrees, one a section: the first signed 16-bit number of
/// each section's record, in hundredths of a degree.
std::vector<double> decode_seri_tilts(std::span<const std::byte> extended_header,
                                      const SeriLayout& seri, const MrcHeader& header);

/// The fixed header of a new file, little-endian, without an extended one.
MrcHeaderBytes encode_mrc_header(const MrcHeader& header);

}  // namespace tomofield::io
