#include "io/images/mrc_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#include "base/check.h"
#include "base/log.h"
#include "base/plausible.h"
#include "io/is_file.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

static_assert(std::endian::native == std::endian::little,
              "MRC files are written in the machine's order, which the stamp calls little-endian");

namespace {

// Byte offsets of MRC2014 (Cheng et al. 2015), and of IMOD's fields in the free area.
enum Offset : std::size_t {
  kSize = 0,
  kMode = 12,
  kSampling = 28,
  kCell = 40,
  kAngles = 52,
  kAxes = 64,
  kMin = 76,
  kMax = 80,
  kMean = 84,
  kSpaceGroup = 88,
  kExtendedBytes = 92,
  kExtendedType = 104,
  kVersion = 108,
  kImodStamp = 152,
  kImodFlags = 156,
  kOrigin = 196,
  kMap = 208,
  kMachineStamp = 212,
  kRms = 216,
  kNumLabels = 220,
  kLabels = 224
};
constexpr std::size_t kLabelBytes = 80;
constexpr int kMaxLabels = 10;
constexpr std::int32_t kImodStampValue = 1146047817;
// Space groups of MRC2014: 0 of images, 1 of a volume, 401 of a stack of volumes, whose MZ counts
// the sections of one.
constexpr std::int32_t kSpaceGroupOfVolume = 1, kSpaceGroupOfVolumes = 401;
constexpr std::int32_t kImodCtfCorrected = 32;
constexpr std::int32_t kImodSignedBytes = 1;
constexpr std::int32_t kImodPacked = 16;         // two values of 4 bits in a byte
constexpr std::int32_t kImodOriginInverted = 4;  // ORIGIN has the sign of MRC2014

// Reads numbers of either byte order from the header.
class Fields {
 public:
  Fields(const MrcHeaderBytes& bytes, bool swapped) : bytes_(bytes), swapped_(swapped) {}

  std::int32_t int32(std::size_t offset) const { return get<std::int32_t>(offset); }
  double float32(std::size_t offset) const { return get<float>(offset); }
  std::string text(std::size_t offset, std::size_t length) const {
    const auto* first = reinterpret_cast<const char*>(bytes_.data() + offset);
    std::string result(first, std::find(first, first + length, '\0'));
    for (char& c : result) {
      if (static_cast<unsigned char>(c) < ' ') c = '?';  // terminals show labels
    }
    result.erase(result.find_last_not_of(' ') + 1);
    return result;
  }

 private:
  template <typename T>
  T get(std::size_t offset) const {
    std::array<std::byte, sizeof(T)> raw;
    std::copy_n(bytes_.data() + offset, sizeof(T), raw.begin());
    if (swapped_) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
  }
  const MrcHeaderBytes& bytes_;
  bool swapped_;
};

bool is_known_mode(std::int32_t mode) {
  return mode == 0 || mode == 1 || mode == 2 || mode == 6 || mode == 12;
}

bool detect_byte_swap(const MrcHeaderBytes& bytes) {
  const auto stamp = std::to_integer<int>(bytes[kMachineStamp]);
  const Fields native(bytes, false), swapped(bytes, true);
  const bool may_be_native = is_known_mode(native.int32(kMode)),
             may_be_swapped = is_known_mode(swapped.int32(kMode));
  // A stamp holds unless the mode makes sense in the other order alone.
  if (stamp == 0x44 && (may_be_native || !may_be_swapped)) return false;
  if (stamp == 0x11 && (may_be_swapped || !may_be_native)) return true;
  // Files from before MRC2014 have no stamp. Then the byte order is the one in which the mode makes
  // sense. Mode 0 is the same in both orders, so the size decides.
  if (native.int32(kMode) != 0) return !may_be_native;
  return static_cast<std::uint32_t>(native.int32(kSize)) >
         static_cast<std::uint32_t>(swapped.int32(kSize));
}

MrcMode decode_mode(std::int32_t mode, const std::string& name) {
  if (is_known_mode(mode)) return static_cast<MrcMode>(mode);
  const char* hint = mode == 3 || mode == 4 ? "complex values"
                     : mode == 101 ? "4-bit values; expand them first (IMOD's newstack -mode 1)"
                                   : "no mode of MRC2014, so this is probably no MRC file";
  throw Error(fmt::format(
      "'{}': MRC mode {} cannot be read ({}); give an MRC file of mode 0, 1, 2, 6 or 12", name,
      mode, hint));
}

void require_sizes(const MrcHeader& header, const std::string& name) {
  if (header.nx > 0 && header.ny > 0 && header.nz > 0) return;
  throw Error(fmt::format(
      "'{}': the header says {} × {} × {} values; every size must be at least 1, so the file is "
      "damaged or no MRC file",
      name, header.nx, header.ny, header.nz));
}

void require_axis_order(const Fields& fields, const std::string& name) {
  const std::array<std::int32_t, 3> axes{fields.int32(kAxes), fields.int32(kAxes + 4),
                                         fields.int32(kAxes + 8)};
  const bool absent = axes == std::array<std::int32_t, 3>{0, 0, 0};
  if (absent || axes == std::array<std::int32_t, 3>{1, 2, 3}) return;
  throw Error(fmt::format(
      "'{}': the axes are stored in the order {}, {}, {} (MAPC, MAPR, MAPS); only 1, 2, 3 can be "
      "read, so bring the axes into that order first",
      name, axes[0], axes[1], axes[2]));
}

// IMOD states values of 4 bits by a flag of mode 0, too.
void require_no_packed_bytes(const Fields& fields, const MrcHeader& header,
                             const std::string& name) {
  if (header.mode != MrcMode::kInt8 || fields.int32(kImodStamp) != kImodStampValue ||
      (fields.int32(kImodFlags) & kImodPacked) == 0)
    return;
  throw Error(
      fmt::format("'{}': its bytes have two values of 4 bits (IMOD's flag {}), which "
                  "cannot be read; expand them first (IMOD's newstack -mode 1)",
                  name, kImodPacked));
}

// Returns cell length over number of samples, never rounded; 0 without samples.
double stated_size_A(const Fields& fields, std::size_t axis) {
  const double cell_A = fields.float32(kCell + 4 * axis);
  const auto samples = static_cast<double>(fields.int32(kSampling + 4 * axis));
  return samples > 0 ? cell_A / samples : 0.0;
}

// Returns the size that the header states; 0 if it has none, or one that cannot be.
double decode_voxel_size(const Fields& fields, std::size_t axis) {
  const double size_A = stated_size_A(fields, axis);
  return base::is_plausible_pixel_size(size_A) ? size_A : 0.0;
}

// Tells whether bytes count from 0 to 255. IMOD's stamp says so; without it, IMOD's rule of the
// minimum and the maximum does (readBytesSigned in b3dutil.c), and bytes are signed, as in MRC2014,
// where these do not tell.
bool has_unsigned_bytes(const Fields& fields, const MrcHeader& header) {
  constexpr double kEndOfSigned = 128;
  if (header.mode != MrcMode::kInt8) return false;
  if (fields.int32(kImodStamp) == kImodStampValue)
    return (fields.int32(kImodFlags) & kImodSignedBytes) == 0;
  if (!(header.max >= kEndOfSigned)) return false;
  return header.min >= 0 || -header.min <= header.max - kEndOfSigned;
}

// Tells whether ORIGIN has IMOD's sign, the opposite of MRC2014's. Versions of this program that
// did not write IMOD's stamp wrote it so.
bool has_imod_origin(const Fields& fields, const MrcHeader& header) {
  if (fields.int32(kImodStamp) == kImodStampValue)
    return (fields.int32(kImodFlags) & kImodOriginInverted) == 0;
  return std::ranges::any_of(
      header.labels, [](const std::string& label) { return label.starts_with("tomofield "); });
}

// Tells whether IMOD takes the first row for the uppermost (mrc_head_read, IIUNIT_Y_INVERTED).
bool has_rows_from_top(const Fields& fields, const MrcHeader& header) {
  constexpr std::int32_t kFirstVersion = 20140;
  const std::string& type = header.extended_header_type;
  return (type == "FEI1" || type == "FEI2") && fields.int32(kVersion) == kFirstVersion &&
         fields.int32(kImodStamp) != kImodStampValue;
}

template <typename T>
void put(MrcHeaderBytes& bytes, std::size_t offset, std::type_identity_t<T> value) {
  std::memcpy(bytes.data() + offset, &value, sizeof value);
}

}  // namespace

std::size_t bytes_per_value(MrcMode mode) {
  if (mode == MrcMode::kInt8) return 1;
  return mode == MrcMode::kFloat32 ? 4 : 2;
}

std::string describe(MrcMode mode) {
  const char* name = mode == MrcMode::kInt8      ? "8-bit integers"
                     : mode == MrcMode::kInt16   ? "16-bit integers"
                     : mode == MrcMode::kUint16  ? "16-bit unsigned integers"
                     : mode == MrcMode::kFloat16 ? "16-bit floats"
                                                 : "32-bit floats";
  return fmt::format("{} (mode {})", name, static_cast<int>(mode));
}

MrcHeader decode_mrc_header(const MrcHeaderBytes& bytes, const std::string& name) {
  if (std::memcmp(bytes.data(), "\x89HDF", 4) == 0) {
    throw Error(fmt::format(
        "'{}' is an HDF5 file, not MRC: if it is a model, `tomofield export` writes a volume of "
        "it, "
        "and a stack is converted by IMOD's newstack -format MRC or EMAN2's e2proc2d.py",
        name));
  }
  MrcHeader header;
  header.is_byte_swapped = detect_byte_swap(bytes);
  const Fields fields(bytes, header.is_byte_swapped);
  header.mode = decode_mode(fields.int32(kMode), name);
  header.nx = fields.int32(kSize);
  header.ny = fields.int32(kSize + 4);
  header.nz = fields.int32(kSize + 8);
  require_sizes(header, name);
  require_axis_order(fields, name);
  require_no_packed_bytes(fields, header, name);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    header.voxel_size_A[axis] = decode_voxel_size(fields, axis);
    header.origin_A[axis] = fields.float32(kOrigin + 4 * axis);
  }
  header.min = fields.float32(kMin);
  header.max = fields.float32(kMax);
  header.mean = fields.float32(kMean);
  header.rms = fields.float32(kRms);
  header.is_volume = fields.int32(kSpaceGroup) == kSpaceGroupOfVolume;
  if (fields.int32(kSpaceGroup) == kSpaceGroupOfVolumes)
    header.sections_a_volume = std::clamp<std::int64_t>(fields.int32(kSampling + 8), 1, header.nz);
  header.bytes_are_unsigned = has_unsigned_bytes(fields, header);
  header.is_ctf_corrected = fields.int32(kImodStamp) == kImodStampValue &&
                            (fields.int32(kImodFlags) & kImodCtfCorrected) != 0;
  header.extended_header_bytes = fields.int32(kExtendedBytes);
  if (header.extended_header_bytes < 0) {
    throw Error(
        fmt::format("'{}': the header says that its extended part has {} bytes; the file "
                    "is damaged or no MRC file",
                    name, header.extended_header_bytes));
  }
  if (header.extended_header_bytes > 0) header.extended_header_type = fields.text(kExtendedType, 4);
  header.has_rows_from_top = has_rows_from_top(fields, header);
  const int num_labels = std::clamp(fields.int32(kNumLabels), 0, kMaxLabels);
  for (int i = 0; i < num_labels; ++i) {
    header.labels.push_back(
        fields.text(kLabels + kLabelBytes * static_cast<std::size_t>(i), kLabelBytes));
  }
  if (has_imod_origin(fields, header)) {
    for (double& origin_A : header.origin_A) origin_A = origin_A == 0.0 ? 0.0 : -origin_A;
  }
  return header;
}

std::int64_t expected_file_bytes(const MrcHeader& header, const std::string& name) {
  const base::CheckedSize values = base::CheckedSize(header.nx) * header.ny * header.nz;
  const auto bytes =
      (values * bytes_per_value(header.mode) + kMrcHeaderBytes + header.extended_header_bytes)
          .find();
  if (bytes) return *bytes;
  throw Error(
      fmt::format("'{}': {} × {} × {} values are more than any file can hold; the header "
                  "is damaged or this is no MRC file",
                  name, header.nx, header.ny, header.nz));
}

namespace {

std::int32_t space_group(const MrcHeader& header) {
  if (header.sections_a_volume > 0) return kSpaceGroupOfVolumes;
  return header.is_volume ? kSpaceGroupOfVolume : 0;
}

}  // namespace

MrcHeaderBytes encode_mrc_header(const MrcHeader& header) {
  MrcHeaderBytes bytes{};
  const std::array<std::int64_t, 3> sizes{header.nx, header.ny, header.nz};
  std::array<std::int64_t, 3> samples = sizes;
  if (header.sections_a_volume > 0) samples[2] = header.sections_a_volume;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put<std::int32_t>(bytes, kSize + 4 * axis, static_cast<std::int32_t>(sizes[axis]));
    put<std::int32_t>(bytes, kSampling + 4 * axis, static_cast<std::int32_t>(samples[axis]));
    put<float>(bytes, kCell + 4 * axis,
               static_cast<float>(header.voxel_size_A[axis] * static_cast<double>(samples[axis])));
    put<float>(bytes, kAngles + 4 * axis, 90.0f);
    put<std::int32_t>(bytes, kAxes + 4 * axis, static_cast<std::int32_t>(axis) + 1);
    put<float>(bytes, kOrigin + 4 * axis, static_cast<float>(header.origin_A[axis]));
  }
  put<std::int32_t>(bytes, kMode, static_cast<std::int32_t>(header.mode));
  put<float>(bytes, kMin, static_cast<float>(header.min));
  put<float>(bytes, kMax, static_cast<float>(header.max));
  put<float>(bytes, kMean, static_cast<float>(header.mean));
  put<float>(bytes, kRms, static_cast<float>(header.rms));
  put<std::int32_t>(bytes, kSpaceGroup, space_group(header));
  put<std::int32_t>(bytes, kVersion, 20141);
  put<std::int32_t>(bytes, kImodStamp, kImodStampValue);
  const std::int32_t signed_bytes = header.mode == MrcMode::kInt8 ? kImodSignedBytes : 0;
  put<std::int32_t>(bytes, kImodFlags, kImodOriginInverted | signed_bytes);
  std::memcpy(bytes.data() + kMap, "MAP ", 4);
  bytes[kMachineStamp] = bytes[kMachineStamp + 1] = std::byte{0x44};
  const std::size_t num_labels = std::min<std::size_t>(header.labels.size(), kMaxLabels);
  put<std::int32_t>(bytes, kNumLabels, static_cast<std::int32_t>(num_labels));
  for (std::size_t i = 0; i < num_labels; ++i) {
    const std::string& label = header.labels[i];
    auto* at = bytes.data() + kLabels + kLabelBytes * i;
    std::memset(at, ' ', kLabelBytes);
    std::memcpy(at, label.data(), std::min(label.size(), kLabelBytes));
  }
  return bytes;
}

namespace {

template <typename T, typename Convert>
void decode_as(std::span<const std::byte> raw, std::span<float> out, Convert convert) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    T value;
    std::memcpy(&value, raw.data() + i * sizeof(T), sizeof(T));
    out[i] = convert(value);
  }
}

template <typename T, typename Convert, typename Restore>
void encode_as(std::span<const float> values, std::span<std::byte> raw, std::span<float> stored,
               Convert convert, Restore restore) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const T value = convert(values[i]);
    std::memcpy(raw.data() + i * sizeof(T), &value, sizeof(T));
    stored[i] = restore(value);
  }
}

template <typename T>
void encode_integers(std::span<const float> values, std::span<std::byte> raw,
                     std::span<float> stored) {
  const auto round_and_clamp = [](float value) {
    if (std::isnan(value)) return T{0};
    constexpr auto kLow = static_cast<float>(std::numeric_limits<T>::min());
    constexpr auto kHigh = static_cast<float>(std::numeric_limits<T>::max());
    return static_cast<T>(std::nearbyint(std::clamp(value, kLow, kHigh)));
  };
  encode_as<T>(values, raw, stored, round_and_clamp, [](T v) { return static_cast<float>(v); });
}

void swap_bytes(std::span<std::byte> raw, std::size_t width) {
  for (std::size_t i = 0; i + width <= raw.size(); i += width) {
    std::reverse(raw.data() + i, raw.data() + i + width);
  }
}

}  // namespace

void decode_values(const MrcHeader& header, std::span<std::byte> raw, std::span<float> out) {
  const std::size_t width = bytes_per_value(header.mode);
  TOMOFIELD_CHECK(raw.size() == out.size() * width, "raw bytes must match the values");
  if (header.is_byte_swapped && width > 1) swap_bytes(raw, width);
  const auto to_float = [](auto value) { return static_cast<float>(value); };
  switch (header.mode) {
    case MrcMode::kInt8:
      return header.bytes_are_unsigned ? decode_as<std::uint8_t>(raw, out, to_float)
                                       : decode_as<std::int8_t>(raw, out, to_float);
    case MrcMode::kInt16:
      return decode_as<std::int16_t>(raw, out, to_float);
    case MrcMode::kUint16:
      return decode_as<std::uint16_t>(raw, out, to_float);
    case MrcMode::kFloat16:
      return decode_as<std::uint16_t>(raw, out, float_from_half);
    case MrcMode::kFloat32:
      return decode_as<float>(raw, out, to_float);
  }
}

void encode_values(MrcMode mode, std::span<const float> values, std::span<std::byte> raw,
                   std::span<float> stored) {
  TOMOFIELD_CHECK(
      raw.size() == values.size() * bytes_per_value(mode) && stored.size() == values.size(),
      "raw bytes and stored values must match the values");
  switch (mode) {
    case MrcMode::kInt8:
      return encode_integers<std::int8_t>(values, raw, stored);
    case MrcMode::kInt16:
      return encode_integers<std::int16_t>(values, raw, stored);
    case MrcMode::kUint16:
      return encode_integers<std::uint16_t>(values, raw, stored);
    case MrcMode::kFloat16:
      return encode_as<std::uint16_t>(values, raw, stored, half_from_float, float_from_half);
    case MrcMode::kFloat32:
      std::memcpy(raw.data(), values.data(), raw.size());
      std::copy(values.begin(), values.end(), stored.begin());
      return;
  }
}

std::optional<MrcFacts> find_mrc_facts(const std::filesystem::path& path, const MrcHeader& header) {
  if (!is_file(path)) return std::nullopt;
  const PositionedFile file(path, PositionedFile::Access::kRead);
  const std::int64_t beyond = file.size() - expected_file_bytes(header, path.string());
  if (beyond < 0) return std::nullopt;
  MrcHeaderBytes bytes;
  file.read_at(0, bytes.data(), bytes.size());
  const Fields fields(bytes, header.is_byte_swapped);
  const bool is_its = fields.int32(kSize) == header.nx && fields.int32(kSize + 4) == header.ny &&
                      fields.int32(kSize + 8) == header.nz &&
                      fields.int32(kMode) == static_cast<std::int32_t>(header.mode);
  if (!is_its) return std::nullopt;
  const auto width = static_cast<std::int64_t>(bytes_per_value(header.mode));
  return MrcFacts{{stated_size_A(fields, 0), stated_size_A(fields, 1), stated_size_A(fields, 2)},
                  beyond / (header.nx * header.ny * width)};
}

bool is_known_size(double size_A) { return size_A > 0.0 && size_A != 1.0; }

double cubic_voxel_size_A(const MrcHeader& header, const std::filesystem::path& path) {
  if (header.sections_a_volume > 0)
    throw Error(fmt::format("'{}' is a stack of volumes (space group 401): give a file of one",
                            path.string()));
  constexpr double kSame = 0.01;  // of calibrations
  const auto& [x_A, y_A, z_A] = header.voxel_size_A;
  const auto differs = [x = x_A](double side_A) {
    return std::fabs(side_A - x) > kSame * std::max(std::fabs(x), std::fabs(side_A));
  };
  const bool has_depth = header.is_volume || (z_A != 0.0 && z_A != 1.0);
  if (!differs(y_A) && !(has_depth && differs(z_A))) return x_A;
  throw Error(
      fmt::format("'{}' has voxels of {:.6g} × {:.6g} × {:.6g} Å, and only cubes are read: correct "
                  "its header (IMOD's alterheader -del), or resample it",
                  path.string(), x_A, y_A, z_A));
}

std::optional<std::string> contradiction_of_mode(const MrcHeader& header) {
  constexpr double kLargestByte = 127.0, kLargestShort = 32767.0;
  const bool is_byte = header.mode == MrcMode::kInt8;
  const bool has_sign = is_byte ? !header.bytes_are_unsigned : header.mode == MrcMode::kInt16;
  const bool has_none = is_byte ? header.bytes_are_unsigned : header.mode == MrcMode::kUint16;
  const bool is_too_large =
      has_sign && header.max > (is_byte ? kLargestByte : kLargestShort) && header.max >= header.min;
  const bool is_negative = has_none && header.min < 0.0 && header.max >= header.min;
  if (!is_too_large && !is_negative) return std::nullopt;
  return fmt::format(
      "has {}-bit numbers with{} sign (mode {}), and its header states values from {:g} to {:g}: "
      "those that do not fit are misread, so convert it (IMOD's newstack -mode 2)",
      is_byte ? 8 : 16, is_too_large ? "" : "out a", static_cast<int>(header.mode), header.min,
      header.max);
}

void warn_of_mode(const MrcHeader& header, const std::string& name) {
  if (const auto contradiction = contradiction_of_mode(header))
    base::log_warning(fmt::format("'{}' {}", name, *contradiction));
}

bool is_phase_flipped(const MrcHeader& header) {
  return header.is_ctf_corrected || is_in_labels(header, "ctfphaseflip");
}

bool is_dose_weighted(const MrcHeader& header) { return is_in_labels(header, "dose weight"); }

bool is_in_labels(const MrcHeader& header, std::string_view word) {
  return std::ranges::any_of(header.labels, [&](std::string label) {
    std::ranges::transform(label, label.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return label.find(word) != std::string::npos;
  });
}

}  // namespace tomofield::io
