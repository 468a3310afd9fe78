#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/images/mrc.h"

namespace tomofield::io {

/// The size of the fixed part of an MRC2014 header in bytes; the extended header follows, then the
/// data.
inline constexpr std::size_t kMrcHeaderBytes = 1024;
using MrcHeaderBytes = std::array<std::byte, kMrcHeaderBytes>;

std::size_t bytes_per_value(MrcMode mode);

/// Returns a name for messages, such as "float32 (mode 2)".
std::string describe(MrcMode mode);

/// Reads the fixed header; `name` stands for the file in errors. Throws Error for sizes that are
/// not positive or overflow, unknown modes, a negative extended header, and axes that are not in x,
/// y, z order.
MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes, const std::string& name);

/// Returns the bytes that a file with this header has. Throws Error if 63 bits cannot hold them.
std::int64_t expected_file_bytes(const MrcHeader& header, const std::string& name);

/// Returns the fixed header of a new file, little-endian, without an extended one.
MrcHeaderBytes encode_mrc_header(const MrcHeader& header);

/// Converts the bytes of a file to floats. `raw` holds out.size() values of the header's mode and
/// byte order; they may be byte-swapped in place.
void decode_values(const MrcHeader& header, std::span<std::byte> raw, std::span<float> out);

/// Converts floats to the bytes of a little-endian file. Integers round to the nearest and are
/// clamped to their range, half floats to ±65504; NaN becomes the integer 0. `stored` receives the
/// values that a reader will find.
void encode_values(MrcMode mode, std::span<const float> values, std::span<std::byte> raw,
                   std::span<float> stored);

inline constexpr float kLargestHalf = 65504.0f;   ///< the largest finite number of binary16
inline constexpr float kSmallestHalf = 0x1p-24f;  ///< of which small numbers are multiples

/// Converts IEEE 754 binary16 bits to float, exactly for every input.
inline float float_from_half(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000u) << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1fu;
  const std::uint32_t fraction = half & 0x3ffu;
  if (exponent == 0) {  // zero or subnormal: fraction · 2⁻²⁴
    const float magnitude = static_cast<float>(fraction) * 0x1p-24f;
    return sign != 0 ? -magnitude : magnitude;
  }
  const std::uint32_t wide_exponent = exponent == 0x1f ? 0xffu : exponent + 112;
  return std::bit_cast<float>(sign | (wide_exponent << 23) | (fraction << 13));
}

/// Converts to the nearest binary16, ties to even; finite values beyond ±65504 become ±65504.
inline std::uint16_t half_from_float(float value) {
  const auto sign =
      static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(value) >> 16) & 0x8000u);
  if (std::isnan(value)) return sign | 0x7e00u;
  if (std::isinf(value)) return sign | 0x7c00u;
  const float magnitude = std::min(std::fabs(value), kLargestHalf);
  if (magnitude < 0x1p-14f) {  // subnormal: a multiple of 2⁻²⁴
    return sign | static_cast<std::uint16_t>(std::lrint(magnitude * 0x1p24f));
  }
  const auto bits = std::bit_cast<std::uint32_t>(magnitude);
  const std::uint32_t ties_to_even = 0xfffu + ((bits >> 13) & 1u);
  return sign | static_cast<std::uint16_t>((bits + ties_to_even - (112u << 23)) >> 13);
}

/// Holds what MrcHeader leaves out of an MRC file: values that cannot be, and trailing bytes.
struct MrcFacts {
  /// Cell lengths over numbers of samples, as the file states them; 0 without samples.
  std::array<double, 3> voxel_size_A{};
  std::int64_t sections_beyond = 0;  ///< whole sections after the last one that it states
};

/// Returns the facts of a file that was read with this header. Returns nothing if it is no MRC file
/// of this header, but a TIFF file, a table that names images, or the name of a stack in memory.
std::optional<MrcFacts> find_mrc_facts(const std::filesystem::path& path, const MrcHeader& header);

/// Tells whether the pixel or voxel size of a header is one. Programs that do not know it write 0,
/// or 1.
bool is_known_size(double size_A);

/// Returns the side of the voxels of a volume, or 0 if it is not known. The size along z counts for
/// nothing in a stack of images where it is 0 or 1. Throws Error for voxels that are no cubes, and
/// for a stack of volumes.
double cubic_voxel_size_A(const MrcHeader& header, const std::filesystem::path& path);

/// A label of volumes that were turned before they were sampled. Their ORIGIN is 0, and no place.
inline constexpr const char* kLabelOfTurnedBox = "turned: ORIGIN is not its place";

/// A label of volumes of a series whose x-axis tilt was turned back.
inline constexpr const char* kLabelOfXTilt = "the x-axis tilt of the series is turned back";

/// Tells whether a stack went through IMOD's ctfphaseflip, by its labels or IMOD's flag.
bool is_phase_flipped(const MrcHeader& header);

/// Tells whether a stack is weighted by the dose, by its labels: IMOD's mtffilter writes
/// "MTFFILTER: Dose weight filtered".
bool is_dose_weighted(const MrcHeader& header);

/// Says of a file, as the rest of a sentence, that its header states values that its mode cannot
/// hold: programs have written unsigned numbers as signed ones, and the other way round. Returns
/// nothing if it does not.
std::optional<std::string> contradiction_of_mode(const MrcHeader& header);
/// Warns of such a header; `name` is that of the file.
void warn_of_mode(const MrcHeader& header, const std::string& name);

/// Tells whether a label of a file has a word, such as the name of a program that has made it.
/// `word` is in lower case; labels may be in any.
bool is_in_labels(const MrcHeader& header, std::string_view word);

}  // namespace tomofield::io
