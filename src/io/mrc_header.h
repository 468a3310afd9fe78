#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "io/mrc.h"

namespace tomofield::io {

/// The size of the fixed part of an MRC2014 header in bytes; the extended header follows, then the
/// data.
inline constexpr std::size_t kMrcHeaderBytes = 1024;
using MrcHeaderBytes = std::array<std::byte, kMrcHeaderBytes>;

std::size_t bytes_per_value(MrcMode mode);

/// Returns a name for messages, such as "float32 (mode 2)".
std::string describe(MrcMode mode);

/// The layout of tilt angles in the extended header, if it holds one for each section.
struct SeriLayout {
  std::int64_t bytes_per_section = 0;  ///< 0 if there are no angles
};

/// Reads the fixed header; `name` stands for the file in errors. Throws Error for sizes that are
/// not positive or overflow, unknown modes, a negative extended header, and axes that are not in x,
/// y, z order.
MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes, const std::string& name, SeriLayout* seri);

/// Returns the bytes that a file with this header has. Throws Error if 63 bits cannot hold them.
std::int64_t expected_file_bytes(const MrcHeader& header, const std::string& name);

/// Returns the tilt angles in degrees, one a section. The first signed 16-bit number of each
/// section's record holds it in hundredths of a degree.
std::vector<double> decode_seri_tilts(std::span<const std::byte> extended_header,
                                      const SeriLayout& seri, const MrcHeader& header);

/// Returns the fixed header of a new file, little-endian, without an extended one.
MrcHeaderBytes encode_mrc_header(const MrcHeader& header);

}  // namespace tomofield::io
