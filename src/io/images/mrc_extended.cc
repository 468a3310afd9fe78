#include "io/images/mrc_extended.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "base/plausible.h"
#include "io/images/mrc_format.h"
#include "io/tables/view_table.h"

namespace tomofield::io {
namespace {

// Of IMOD and SerialEM: two 16-bit numbers, whose meaning depends on the layout.
constexpr std::size_t kFirstShort = 128, kSecondShort = 130;
constexpr double kLargestTilt_deg = 180.0;
constexpr double kAngstroms_in_m = 1e10;
constexpr double kSamePixel = 0.02;  // of calibrations
constexpr double kSameAxis_deg = 1.0;
constexpr std::string_view kPixelsInA = "pixels in Å", kAxisInDegrees = "a tilt axis in degrees";

// Returns the number at an offset in a file of either byte order.
template <typename T>
T number_at(std::span<const std::byte> bytes, std::int64_t offset, bool is_swapped) {
  std::array<std::byte, sizeof(T)> raw;
  std::copy_n(bytes.begin() + offset, sizeof(T), raw.begin());
  if (is_swapped) std::ranges::reverse(raw);
  return std::bit_cast<T>(raw);
}

// What SerialEM's flags announce in the record of a section, in this order (IMOD's description of
// the header).
enum SerialEmFlag { kTilt = 1, kPieces = 2, kStage = 4, kMagnification = 8 };
constexpr std::array<int, 6> kBytesOfFlag{2, 6, 4, 2, 2, 4};

// Returns the bytes a section that the first `count` of SerialEM's flags announce.
int bytes_of_section_flags(int flags, std::size_t count = kBytesOfFlag.size()) {
  int bytes = 0;
  for (std::size_t bit = 0; bit < count; ++bit) {
    if ((flags >> bit) & 1) bytes += kBytesOfFlag[bit];
  }
  return bytes;
}

// Returns the offset in a record of SerialEM of what a flag announces.
int offset_of(SerialEmFlag flag, int flags) {
  return bytes_of_section_flags(
      flags, static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(flag))));
}

// Takes the angles of all sections, if every one of them can be. Equal ones are not those of a tilt
// series: records without a tilt have 0.
void take_tilts(std::vector<double> tilts_deg, MrcHeader& header) {
  const bool are_angles = std::ranges::all_of(
      tilts_deg, [](double tilt) { return base::is_plausible(tilt, kLargestTilt_deg); });
  const bool differ =
      std::ranges::any_of(tilts_deg, [&](double tilt) { return tilt != tilts_deg.front(); });
  if (are_angles && (differ || header.nz == 1)) header.extended_tilt_deg = std::move(tilts_deg);
}

// Notes that records after those of the sections state tilts, too: it cannot be told whose they
// are.
void refuse_surplus(MrcHeader& header) {
  header.extended_tilt_deg.clear();
  header.differences.push_back(fmt::format(
      "tilts of more sections than its {}, which are not taken: give the right ones (--tlt)",
      header.nz));
}

void take_pixel_size(double width_A, double height_A, MrcHeader& header) {
  if (!base::is_plausible_pixel_size(width_A)) return;
  header.extended_pixel_A = width_A;
  if (is_known_size(header.voxel_size_A[0])) return;
  header.voxel_size_A = {width_A, height_A, width_A};
}

// Notes the first section in which the extended header states another value than in the first one.
// `of_section(i)` returns the value, or nothing.
template <typename OfSection>
void note_difference(std::string_view what, const OfSection& of_section, double tolerance,
                     MrcHeader& header) {
  const std::optional<double> first = of_section(0);
  for (std::int64_t section = 1; section < header.nz && first; ++section) {
    const std::optional<double> other = of_section(section);
    if (!other || !(std::fabs(*other - *first) > tolerance)) continue;
    header.differences.push_back(
        fmt::format("{} of {:.6g} in section {}, and of {:.6g} in the first, which is taken", what,
                    *other, section + 1, *first));
    return;
  }
}

void take_axis(double axis_deg, MrcHeader& header) {
  if (base::is_plausible(axis_deg, base::kLargestAngle_deg))
    header.extended_axis_deg = std::remainder(axis_deg, 360.0);
  else
    header.differences.push_back(fmt::format(
        "a tilt axis of {:g}°, which cannot be: give the right one with --tilt-axis", axis_deg));
}

// Takes a voltage in V. Some programs have written kV.
void take_voltage(double voltage, MrcHeader& header) {
  constexpr double kVolts_in_kV = 1e3;
  for (const double voltage_kV : {voltage / kVolts_in_kV, voltage})
    if (kVoltages_kV.find(voltage_kV)) header.extended_voltage_kV = voltage_kV;
}

// Tells whether two sections have the same place along Z, by the coordinates of pieces.
bool has_pieces(std::span<const std::byte> extended, const ExtendedRecords& records,
                const MrcHeader& header) {
  const std::int64_t z = offset_of(kPieces, records.flags) + 4;  // after x and y
  std::set<std::int16_t> places;
  for (std::int64_t section = 0; section < header.nz; ++section)
    if (!places
             .insert(number_at<std::int16_t>(extended, section * records.bytes_per_section + z,
                                             header.is_byte_swapped))
             .second)
      return true;
  return false;
}

// Tells whether a record after those of the sections has a tilt. Unused ones have zeros.
template <typename TiltOf>
bool has_surplus(std::span<const std::byte> extended, const ExtendedRecords& records,
                 const MrcHeader& header, const TiltOf& tilt_of) {
  const std::int64_t count = std::ssize(extended) / records.bytes_per_section;
  for (std::int64_t section = header.nz; section < count; ++section)
    if (tilt_of(section) != 0.0) return true;
  return false;
}

void read_serialem(std::span<const std::byte> extended, const ExtendedRecords& records,
                   MrcHeader& header) {
  const auto number = [&](SerialEmFlag flag, std::int64_t section) {
    return static_cast<double>(number_at<std::int16_t>(
        extended, section * records.bytes_per_section + offset_of(flag, records.flags),
        header.is_byte_swapped));
  };
  header.has_pieces = (records.flags & kPieces) != 0 && has_pieces(extended, records, header);
  if ((records.flags & kMagnification) != 0)
    note_difference(
        "a magnification over 100",
        [&](std::int64_t section) { return std::optional(number(kMagnification, section)); }, 0.0,
        header);
  if ((records.flags & kTilt) == 0) return;
  std::vector<double> tilts_deg;
  for (std::int64_t section = 0; section < header.nz; ++section)
    tilts_deg.push_back(number(kTilt, section) / 100.0);
  header.extended_tilt_deg = std::move(tilts_deg);
  if (has_surplus(extended, records, header,
                  [&](std::int64_t section) { return number(kTilt, section); }))
    refuse_surplus(header);
}

void read_floats(std::span<const std::byte> extended, const ExtendedRecords& records,
                 MrcHeader& header) {
  constexpr std::int64_t kAxis = 10, kPixel = 11, kVoltage = 13;
  const auto value = [&](std::int64_t section, std::int64_t index) {
    return static_cast<double>(number_at<float>(
        extended, section * records.bytes_per_section + records.first_float + 4 * index,
        header.is_byte_swapped));
  };
  std::vector<double> tilts_deg;
  for (std::int64_t section = 0; section < header.nz; ++section)
    tilts_deg.push_back(value(section, 0));
  take_tilts(std::move(tilts_deg), header);
  if (has_surplus(extended, records, header,
                  [&](std::int64_t section) { return value(section, 0); }))
    refuse_surplus(header);
  if (records.num_floats <= kPixel) return;
  const auto axis_deg = [&](std::int64_t section) {
    return records.is_fei ? -value(section, kAxis) : value(section, kAxis);
  };
  take_axis(axis_deg(0), header);
  note_difference(kAxisInDegrees, axis_deg, kSameAxis_deg, header);
  if (records.is_fei && records.num_floats > kVoltage) take_voltage(value(0, kVoltage), header);
  constexpr double kSmallest_A = 0.05;  // a smaller number is in metres
  const auto pixel_A = [&](std::int64_t section) {
    const double pixel = value(section, kPixel);
    return pixel > kSmallest_A ? pixel : kAngstroms_in_m * pixel;
  };
  take_pixel_size(pixel_A(0), pixel_A(0), header);
  note_difference(kPixelsInA, pixel_A, kSamePixel * std::fabs(pixel_A(0)), header);
}

// One record of FEI1 or FEI2.
class FeiRecord {
 public:
  static constexpr std::int64_t kSmallest = 172;  // bytes up to the pixel size

  FeiRecord(std::span<const std::byte> bytes, bool is_swapped)
      : bytes_(bytes), is_swapped_(is_swapped) {}

  std::int64_t size() const { return number_at<std::int32_t>(bytes_, 0, is_swapped_); }
  std::optional<double> tilt_deg() const { return angle(kTilt); }
  // FEI's angle of the axis has the opposite sign of IMOD's.
  std::optional<double> axis_deg() const {
    const auto found = angle(kAxis);
    return found ? std::optional(-*found) : std::nullopt;
  }
  std::optional<double> pixel_width_A() const { return length_A(kPixel); }
  std::optional<double> pixel_height_A() const { return length_A(kPixelHeight); }
  std::optional<double> voltage_V() const { return value(kVoltage); }

 private:
  struct Field {
    std::int64_t offset;
    int bit;  // of the first mask
  };
  static constexpr Field kVoltage{84, 5}, kTilt{100, 7}, kAxis{140, 12}, kPixel{156, 14},
      kPixelHeight{164, 15};

  std::optional<double> length_A(Field field) const {
    const auto size_m = value(field);
    return size_m ? std::optional(kAngstroms_in_m * *size_m) : std::nullopt;
  }

  std::optional<double> value(Field field) const {
    const auto mask = number_at<std::uint32_t>(bytes_, 8, is_swapped_);
    if (((mask >> field.bit) & 1u) == 0) return std::nullopt;
    return number_at<double>(bytes_, field.offset, is_swapped_);
  }
  // One version of FEI's software has written radians (IMOD's getFeiExtHeadAngleScale).
  std::optional<double> angle(Field field) const {
    constexpr std::string_view kOfRadians("4.4.0.4981\0", 11);
    constexpr std::size_t kVersion = 68;
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
    const auto found = value(field);
    if (!found || text.substr(kVersion, kOfRadians.size()) != kOfRadians) return found;
    return *found * 180.0 / std::numbers::pi;
  }

  std::span<const std::byte> bytes_;
  bool is_swapped_;
};

void read_fei(std::span<const std::byte> extended, MrcHeader& header) {
  std::vector<double> tilts_deg;
  std::vector<FeiRecord> records;
  bool has_surplus = false;
  for (std::size_t at = 0; at + FeiRecord::kSmallest <= extended.size() && !has_surplus;) {
    const FeiRecord record(extended.subspan(at), header.is_byte_swapped);
    if (record.size() < FeiRecord::kSmallest) break;
    at += static_cast<std::size_t>(record.size());
    const auto tilt_deg = record.tilt_deg();
    if (std::ssize(records) == header.nz) {
      has_surplus = tilt_deg.value_or(0.0) != 0.0;
      continue;
    }
    if (tilt_deg) tilts_deg.push_back(*tilt_deg);
    records.push_back(record);
  }
  if (records.empty()) return;
  if (std::ssize(records) < header.nz)
    header.differences.push_back(
        fmt::format("metadata of {} of its {} sections: their tilts are "
                    "not taken",
                    records.size(), header.nz));
  else if (std::ssize(tilts_deg) == header.nz)
    take_tilts(std::move(tilts_deg), header);
  if (has_surplus) refuse_surplus(header);
  const FeiRecord& first = records.front();
  if (const auto width_A = first.pixel_width_A())
    take_pixel_size(*width_A, first.pixel_height_A().value_or(*width_A), header);
  take_voltage(first.voltage_V().value_or(0.0), header);
  if (const auto axis_deg = first.axis_deg()) take_axis(*axis_deg, header);
  const auto of = [&](auto value) {
    return [&records, value](std::int64_t section) {
      const auto at = static_cast<std::size_t>(section);
      return at < records.size() ? (records[at].*value)() : std::nullopt;
    };
  };
  constexpr double kSameVoltage_V = 1.0;
  note_difference(kAxisInDegrees, of(&FeiRecord::axis_deg), kSameAxis_deg, header);
  note_difference("a voltage in V", of(&FeiRecord::voltage_V), kSameVoltage_V, header);
  note_difference(kPixelsInA, of(&FeiRecord::pixel_width_A),
                  kSamePixel * std::fabs(first.pixel_width_A().value_or(0.0)), header);
}

}  // namespace

ExtendedRecords find_extended_records(const MrcHeaderBytes& bytes, const MrcHeader& header) {
  const std::int64_t first = number_at<std::int16_t>(bytes, kFirstShort, header.is_byte_swapped);
  const std::int64_t second = number_at<std::int16_t>(bytes, kSecondShort, header.is_byte_swapped);
  const std::string& type = header.extended_header_type;
  const bool is_of_fei = !header.labels.empty() && header.labels.front().starts_with("Fei ");
  const auto fits = [&](std::int64_t record) {
    return record > 0 && record * header.nz <= header.extended_header_bytes;
  };
  if (type == "FEI1" || type == "FEI2") return {.layout = ExtendedLayout::kFei};
  // Files older than the type code are recognised by sizes that agree.
  const bool is_serialem =
      type == "SERI" || (type.empty() && first == bytes_of_section_flags(static_cast<int>(second)));
  if (is_serialem) {
    if (first < 2 || !fits(first)) return {};
    std::size_t count = kBytesOfFlag.size();
    while (bytes_of_section_flags(static_cast<int>(second), count) > first) --count;
    return {.layout = ExtendedLayout::kSerialEm,
            .bytes_per_section = first,
            .flags = static_cast<int>(second) & ((1 << count) - 1)};
  }
  if ((!type.empty() && type != "AGAR") || first < 0 || second < 1) return {};
  // FEI's first programs wrote the bytes of a record in place of the number of integers, which is 0
  // (IMOD's mrc_head_read, IIUNIT_NINT_BUG).
  constexpr std::int64_t kFeiFloats = 32, kFeiRecord = 128, kFeiBytes = 131072;
  const bool has_bytes_of_record = first == kFeiRecord && second == kFeiFloats &&
                                   (is_of_fei || header.extended_header_bytes == kFeiBytes);
  const std::int64_t num_integers = has_bytes_of_record ? 0 : first;
  const std::int64_t record = 4 * (num_integers + second);
  if (!fits(record)) return {};
  return {.layout = ExtendedLayout::kFloats,
          .bytes_per_section = record,
          .first_float = 4 * num_integers,
          .num_floats = second,
          .is_fei = is_of_fei};
}

void read_extended_records(std::span<const std::byte> extended, const ExtendedRecords& records,
                           MrcHeader& header) {
  switch (records.layout) {
    case ExtendedLayout::kNone:
      return;
    case ExtendedLayout::kSerialEm:
      return read_serialem(extended, records, header);
    case ExtendedLayout::kFei:
      return read_fei(extended, header);
    case ExtendedLayout::kFloats:
      return read_floats(extended, records, header);
  }
}

}  // namespace tomofield::io
