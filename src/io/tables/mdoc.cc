#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "io/named_file.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// The part of the file that a line is in. Lines below a head of another kind, such as
// [MontSection = 0], are not of the section before.
enum class Part { kHead, kSection, kOther };

struct KeyValue {
  std::string_view key, value;
};

// Splits "key = value". Returns an empty key for lines of another form.
KeyValue split_key_value(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) return {};
  return {trim(text.substr(0, equals)), trim(text.substr(equals + 1))};
}

[[noreturn]] void throw_montage(const std::string& where) {
  throw Error(
      fmt::format("{}: a montage of pieces is not read: blend them into one image a view "
                  "(IMOD's blendmont), and give that stack",
                  where));
}

double require_number(const std::filesystem::path& path, const TextLine& line,
                      std::string_view word, double largest) {
  const auto value = parse_number(word, largest);
  if (value) return *value;
  throw Error(fmt::format("'{}', line {}: '{}' does not give a number from -{} to {}",
                          path.string(), line.number, quote(line.text), largest, largest));
}

// The angles of a tilt axis that an .mdoc has, before it is known what they mean.
struct StatedAxes {
  std::optional<AxisAngle> serialem, tomography, entry;
  std::optional<AxisAngle> rotation;  // the first RotationAngle: 90° more than the axis (SerialEM)
  std::optional<AxisAngle> other_rotation;  // one that differs from it
  int two_directions_line = 0;  // of a title that states a bidirectional or dose-symmetric scheme
};

// Notes the angle of "[T = Tilt axis angle = 85.9, binning = 1 …]" and of Tomography's
// "[T = TiltAxisAngle = -175.9 …]". Other titles have none.
void read_title(const std::filesystem::path& path, const TextLine& line, StatedAxes& axes) {
  const auto angle = [&](std::string_view word) {
    return AxisAngle{require_number(path, line, word, base::kLargestAngle_deg), line.number};
  };
  const auto set = [&](std::optional<std::string_view> word, std::optional<AxisAngle>& axis) {
    if (!word) return;
    const AxisAngle found = angle(*word);
    if (axis && axis->value != found.value)
      throw Error(
          fmt::format("'{}', line {}: the tilt axis is {}°, and {}° in line {}: a series "
                      "has one, so leave one out",
                      path.string(), line.number, found.value, axis->value, axis->line));
    axis = found;
  };
  if (line.text.find("bidir =") != std::string::npos ||
      line.text.find("dosym =") != std::string::npos)
    axes.two_directions_line = line.number;
  set(axis_of_title(line.text), axes.serialem);
  set(tomography_axis_of_title(line.text), axes.tomography);
}

[[noreturn]] void throw_two_axes(const std::filesystem::path& path, std::string_view key,
                                 const AxisAngle& first, const AxisAngle& other) {
  throw Error(fmt::format(
      "'{}', line {}: {} is {}°, and {}° in line {}: a series has one tilt axis, so correct it",
      path.string(), other.line, key, other.value, first.value, first.line));
}

// Notes if a title and TiltAxisAngle state two axes.
void note_other_axis(const StatedAxes& axes, Mdoc& mdoc) {
  if (!axes.entry || !mdoc.tilt_axis_deg) return;
  Mdoc by_entry = mdoc;
  set_axis_of_tomography(*axes.entry, /*is_title=*/false, by_entry);
  if (are_two_axes(by_entry.tilt_axis_deg->value, mdoc.tilt_axis_deg->value))
    mdoc.differences.push_back(
        fmt::format("a tilt axis of {}° in line {}, which is taken, and of {}° in line {}: give "
                    "the right one with --tilt-axis",
                    mdoc.tilt_axis_deg->value, mdoc.tilt_axis_deg->line,
                    by_entry.tilt_axis_deg->value, axes.entry->line));
}

// Notes if SerialEM's title and a RotationAngle state two axes. The angle is 90° more than the
// axis, up to half turns.
void note_other_rotation(const StatedAxes& axes, Mdoc& mdoc) {
  constexpr double kSame_deg = 10.0;
  for (const auto& rotation : {axes.rotation, axes.other_rotation}) {
    if (!axes.serialem || !rotation) continue;
    const double rest_deg = std::remainder(rotation->value - 90.0 - axes.serialem->value, 180.0);
    if (std::fabs(rest_deg) <= kSame_deg) continue;
    mdoc.differences.push_back(
        fmt::format("a tilt axis of {}° in line {}, which is taken, and a RotationAngle of {}° in "
                    "line {}, which belongs to one of {}°: give the right one with --tilt-axis",
                    axes.serialem->value, axes.serialem->line, rotation->value, rotation->line,
                    rotation->value - 90.0));
    return;
  }
}

// Sets the axis of the first of the angles there are.
void choose_axis(const std::filesystem::path& path, const StatedAxes& axes, Mdoc& mdoc) {
  if (axes.serialem) {
    mdoc.tilt_axis_deg = axes.serialem;
  } else if (axes.tomography) {
    set_axis_of_tomography(*axes.tomography, /*is_title=*/true, mdoc);
  } else if (axes.entry) {
    set_axis_of_tomography(*axes.entry, /*is_title=*/false, mdoc);
  } else if (axes.rotation) {
    if (axes.other_rotation)
      throw_two_axes(path, "RotationAngle", *axes.rotation, *axes.other_rotation);
    mdoc.lone_rotation_deg = axes.rotation;
  }
  note_other_axis(axes, mdoc);
  note_other_rotation(axes, mdoc);
}

constexpr double kLargestDefocus_um = 1000;

// Returns a voltage, or nothing for 0 or -1, which SerialEM writes if it does not know it. Throws
// Error for one that no microscope has.
std::optional<double> parse_voltage_kV(const std::filesystem::path& path, const TextLine& line,
                                       std::string_view word) {
  const double voltage_kV = require_number(path, line, word, base::kLargestNumber);
  if (voltage_kV == 0.0 || voltage_kV == -1.0) return std::nullopt;
  if (kVoltages_kV.find(voltage_kV)) return voltage_kV;
  throw Error(fmt::format("'{}', line {}: no microscope has a voltage of {} kV", path.string(),
                          line.number, voltage_kV));
}

// Returns a pixel size, or 0 if it is not known. Throws Error for one that cannot be.
double require_spacing_A(const std::filesystem::path& path, const TextLine& line,
                         std::string_view word) {
  const double spacing_A = require_number(path, line, word, base::kLargestNumber);
  if (spacing_A == 0.0 || base::is_plausible_pixel_size(spacing_A)) return spacing_A;
  throw Error(
      fmt::format("'{}', line {}: PixelSpacing is {} Å, and pixels have {} to {} Å: correct "
                  "it, or write 0 if the size is not known",
                  path.string(), line.number, spacing_A, base::kPixelSizes_A.low(),
                  base::kPixelSizes_A.high()));
}

// Reads two whole numbers, as of ImageSize. A point and zeros may follow them.
std::optional<std::array<std::int64_t, 2>> parse_size(std::string_view text) {
  constexpr double kMostPixels = 1e6;  // along a side
  const auto words = split_words(text);
  if (words.size() != 2) return std::nullopt;
  const auto width = parse_number(words[0], kMostPixels),
             height = parse_number(words[1], kMostPixels);
  const auto is_size = [](const auto& side) {
    return side && *side >= 1.0 && *side == std::floor(*side);
  };
  if (!is_size(width) || !is_size(height)) return std::nullopt;
  return std::array{static_cast<std::int64_t>(*width), static_cast<std::int64_t>(*height)};
}

// Returns n of "[ZValue = n]", and nothing for other heads such as "[T = …]" and
// "[MontSection = …]".
std::optional<std::int64_t> parse_section_head(const std::filesystem::path& path,
                                               const TextLine& line) {
  const std::string_view inside = std::string_view(line.text).substr(1, line.text.find(']') - 1);
  const KeyValue head = split_key_value(inside);
  if (head.key != "ZValue") return std::nullopt;
  const auto section = parse_integer(head.value);
  if (section && *section >= 0) return *section;
  throw Error(fmt::format("'{}', line {}: '{}' does not give a section number", path.string(),
                          line.number, quote(line.text)));
}

void sort_and_require_unique(const std::filesystem::path& path, Mdoc* mdoc) {
  auto& sections = mdoc->sections;
  std::stable_sort(
      sections.begin(), sections.end(),
      [](const MdocSection& a, const MdocSection& b) { return a.section < b.section; });
  for (std::size_t i = 1; i < sections.size(); ++i) {
    if (sections[i].section == sections[i - 1].section) {
      throw Error(fmt::format("'{}', line {}: section [ZValue = {}] comes twice", path.string(),
                              sections[i].line, sections[i].section));
    }
  }
}

// Returns the number of a month's name, or 0.
std::int64_t month_named(std::string_view name) {
  constexpr std::string_view kMonths = "JanFebMarAprMayJunJulAugSepOctNovDec";
  const std::size_t at = name.size() == 3 ? kMonths.find(name) : std::string_view::npos;
  return at == std::string_view::npos || at % 3 != 0 ? 0 : static_cast<std::int64_t>(at / 3 + 1);
}

// Splits "12:30:05" or "2021-03-12" into three parts; they are empty if there are not three.
std::array<std::string_view, 3> three_parts(std::string_view text, char separator) {
  const std::size_t first = text.find(separator);
  const std::size_t second =
      first == std::string_view::npos ? first : text.find(separator, first + 1);
  if (second == std::string_view::npos) return {};
  return {text.substr(0, first), text.substr(first + 1, second - first - 1),
          text.substr(second + 1)};
}

// Reads "12-Mar-21  15:31:02", "12-Mar-2021 15:31:02" or "2021-03-12 15:31:02". Returns nothing
// for another form.
std::optional<std::int64_t> parse_time(std::string_view text) {
  const auto words = split_words(text);
  if (words.size() != 2) return std::nullopt;
  auto date = three_parts(words[0], '-');
  if (date[0].size() == 4) std::swap(date[0], date[2]);
  const std::int64_t named = month_named(date[1]);
  const auto day = parse_integer(date[0]), year = parse_integer(date[2]);
  const auto month = named > 0 ? std::optional(named) : parse_integer(date[1]);
  std::int64_t seconds = 0;
  for (const std::string_view part : three_parts(words[1], ':')) {
    const auto number = parse_integer(part);
    if (!number || *number < 0 || *number > 60) return std::nullopt;
    seconds = 60 * seconds + *number;
  }
  constexpr std::int64_t kCentury = 2000;  // of years that are written with two digits
  const auto is_small = [](std::int64_t number) { return number >= 0 && number <= 9999; };
  if (!day || !month || !year || !is_small(*day) || !is_small(*month) || !is_small(*year))
    return std::nullopt;
  const std::chrono::year_month_day on_day{
      std::chrono::year(static_cast<int>(*year < 100 ? kCentury + *year : *year)),
      std::chrono::month(static_cast<unsigned>(*month)),
      std::chrono::day(static_cast<unsigned>(*day))};
  if (!on_day.ok()) return std::nullopt;
  const std::chrono::seconds midnight = std::chrono::sys_days(on_day).time_since_epoch();
  return midnight.count() + seconds;
}

// Returns the dose that an entry says, which must be a number of 0 or more.
double require_dose(const std::filesystem::path& path, const TextLine& line,
                    const KeyValue& entry) {
  const double dose = require_number(path, line, entry.value, kLargestDose);
  if (dose >= 0.0) return dose;
  throw Error(fmt::format("'{}', line {}: {} is {}, and a dose cannot be negative", path.string(),
                          line.number, entry.key, dose));
}

// Returns the number of an entry; nothing for nan, of a session without it.
std::optional<double> find_number(const std::filesystem::path& path, const TextLine& line,
                                  const KeyValue& entry, double largest) {
  constexpr std::array<std::string_view, 3> kNone{"nan", "NaN", "NAN"};
  if (std::ranges::find(kNone, entry.value) != kNone.end()) return std::nullopt;
  if (const auto number = parse_number(entry.value, largest)) return *number;
  throw Error(fmt::format("'{}', line {}: {} is '{}', and a number from -{} to {} is expected",
                          path.string(), line.number, entry.key, quote(entry.value), largest,
                          largest));
}

// Notes a RotationAngle. 0 stands for no angle.
void read_rotation(const std::filesystem::path& path, const TextLine& line, const KeyValue& entry,
                   StatedAxes& axes) {
  const auto angle_deg = find_number(path, line, entry, base::kLargestAngle_deg);
  if (angle_deg.value_or(0.0) == 0.0) return;
  const AxisAngle stated{*angle_deg, line.number};
  if (!axes.rotation)
    axes.rotation = stated;
  else if (!axes.other_rotation && are_two_axes(axes.rotation->value, *angle_deg))
    axes.other_rotation = stated;
}

// Notes where a section states another magnification or binning of its image than a line before.
class Magnifications {
 public:
  void read(const TextLine& line, const KeyValue& entry, Mdoc& mdoc) {
    if (entry.key != "Magnification" && entry.key != "Binning") return;
    const auto number = parse_number(entry.value);
    if (!number || *number == 0.0) return;
    const auto [first, is_new] = first_.emplace(entry.key, NumberLine{*number, line.number});
    if (is_new || first->second.value == *number || is_noted_) return;
    is_noted_ = true;
    mdoc.differences.push_back(
        fmt::format("{} = {} in line {}, and {} in line {}: the views of a series have one size of "
                    "pixels, so leave those of another out (--exclude)",
                    entry.key, first->second.value, first->second.line, *number, line.number));
  }

 private:
  std::map<std::string, NumberLine, std::less<>> first_;
  bool is_noted_ = false;
};

// The entries of a section, or of the head, that have been read: a second one must say the same.
class EntriesOfSection {
 public:
  void require_new(const std::filesystem::path& path, const TextLine& line, const KeyValue& entry,
                   Part part) {
    constexpr std::array<std::string_view, 10> kRead{
        "TiltAngle",     "PriorRecordDose", "ExposureDose", "DateTime",  "RotationAngle",
        "TargetDefocus", "SubFramePath",    "PixelSpacing", "ImageFile", "ImageSize"};
    if (std::ranges::find(kRead, entry.key) == kRead.end()) return;
    const auto [other, is_new] = values_.emplace(entry.key, entry.value);
    if (!is_new && other->second != entry.value)
      throw Error(fmt::format("'{}', line {}: {} comes twice {}, as '{}' and '{}'", path.string(),
                              line.number, entry.key,
                              part == Part::kHead ? "above the sections" : "in its section",
                              quote(other->second), quote(entry.value)));
  }

 private:
  std::map<std::string, std::string, std::less<>> values_;
};

// Sets what an entry of a section says.
void read_section_entry(const std::filesystem::path& path, const TextLine& line,
                        const KeyValue& entry, MdocSection* section) {
  if (entry.key == "TiltAngle") {
    section->tilt_deg = require_number(path, line, entry.value, base::kLargestAngle_deg);
    section->line = line.number;
  } else if (entry.key == "PriorRecordDose") {
    section->prior_dose = require_dose(path, line, entry);
  } else if (entry.key == "ExposureDose") {
    section->dose = require_dose(path, line, entry);
  } else if (entry.key == "FrameDosesAndNumber") {
    const auto of_frame = parse_number(split_words(entry.value).front());
    if (!of_frame || *of_frame != 0.0) section->frame_doses_line = line.number;
  } else if (entry.key == "DateTime") {
    section->time_s = parse_time(entry.value);
    section->unread_time_line = section->time_s ? 0 : line.number;
  } else if (entry.key == "RotationAngle") {
    section->rotation_deg = find_number(path, line, entry, base::kLargestAngle_deg);
  } else if (entry.key == "TargetDefocus") {
    section->target_defocus_um = find_number(path, line, entry, kLargestDefocus_um);
  } else if (entry.key == "SubFramePath") {
    section->frame_name = without_folders(entry.value);
  } else if (entry.key == "PieceCoordinates") {
    section->place_of_piece = entry.value.substr(0, entry.value.find_last_of(' '));
  }
}

// Throws Error for a voltage or a pixel size that differs from an earlier one.
void require_same(const std::filesystem::path& path, const TextLine& line, std::string_view key,
                  double value, double before) {
  constexpr double kRounding = 0.01;
  if (std::fabs(value - before) <= kRounding * before) return;
  throw Error(fmt::format("'{}', line {}: {} is {}, and {} before: a series has one, so correct it",
                          path.string(), line.number, key, value, before));
}

// Sets what an entry above all sections says.
void read_head_entry(const TextLine& line, const KeyValue& entry, Mdoc& mdoc) {
  if (entry.key == "ImageFile") {
    mdoc.image_file = without_folders(entry.value);
  } else if (entry.key == "ImageSize") {
    mdoc.image_size_px = parse_size(entry.value);
    if (!mdoc.image_size_px)
      mdoc.differences.push_back(fmt::format(
          "ImageSize = {} in line {}, which is no width and height in pixels, so nothing "
          "tells of which images PixelSpacing is: give the size with --pixel-size",
          quote(entry.value), line.number));
  } else if (entry.key == "Montage") {
    mdoc.is_montage = entry.value != "0";
  }
}

// Sets what an entry says that may stand above the sections and in them. Returns false for others.
bool read_common_entry(const std::filesystem::path& path, const TextLine& line,
                       const KeyValue& entry, StatedAxes& axes, Mdoc& mdoc) {
  if (entry.key == "PixelSpacing") {
    const double spacing_A = require_spacing_A(path, line, entry.value);
    const double before_A = mdoc.pixel_spacing_A.value_or(0.0);
    if (before_A > 0.0 && spacing_A > 0.0) require_same(path, line, entry.key, spacing_A, before_A);
    if (before_A == 0.0) mdoc.pixel_spacing_A = spacing_A;
  } else if (entry.key == "TiltAxisAngle") {
    const double axis_deg = require_number(path, line, entry.value, base::kLargestAngle_deg);
    const AxisAngle stated{axis_deg, line.number};
    if (axes.entry && are_two_axes(axes.entry->value, axis_deg))
      throw_two_axes(path, entry.key, *axes.entry, stated);
    if (!axes.entry) axes.entry = stated;
  } else if (entry.key == "Voltage") {
    const auto voltage_kV = parse_voltage_kV(path, line, entry.value);
    if (voltage_kV && mdoc.voltage_kV)
      require_same(path, line, entry.key, *voltage_kV, *mdoc.voltage_kV);
    if (voltage_kV) mdoc.voltage_kV = voltage_kV;
  } else {
    return false;
  }
  return true;
}

// The pieces of a montage have places of their own, and one tilt together. A montage of one piece a
// view is a tilt series.
void require_no_pieces(const std::filesystem::path& path, const Mdoc& mdoc) {
  constexpr double kSameTilt_deg = 0.01;
  for (std::size_t i = 1; i < mdoc.sections.size(); ++i) {
    const MdocSection &section = mdoc.sections[i], &before = mdoc.sections[i - 1];
    if (section.place_of_piece != before.place_of_piece)
      throw_montage(
          fmt::format("'{}': PieceCoordinates of [ZValue = {}]", path.string(), section.section));
    if (mdoc.is_montage && section.place_of_piece.empty() && section.tilt_deg && before.tilt_deg &&
        std::fabs(*section.tilt_deg - *before.tilt_deg) < kSameTilt_deg)
      throw_montage(fmt::format("'{}': Montage, and the tilt of [ZValue = {}] and [ZValue = {}]",
                                path.string(), before.section, section.section));
  }
}

}  // namespace

Mdoc read_mdoc(const std::filesystem::path& path) {
  Mdoc mdoc;
  StatedAxes axes;
  Part part = Part::kHead;
  EntriesOfSection entries;
  Magnifications magnifications;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with("[T") || split_key_value(line.text).key == "T") {
      read_title(path, line, axes);  // stands anywhere, and does not end a section
      continue;
    }
    if (line.text.starts_with('[')) {
      const auto section = parse_section_head(path, line);
      part = section ? Part::kSection : Part::kOther;
      if (section) {
        mdoc.sections.emplace_back();
        mdoc.sections.back().section = *section;
        mdoc.sections.back().line = line.number;
      }
      entries = {};
      continue;
    }
    const KeyValue entry = split_key_value(line.text);
    if (entry.value.empty()) continue;  // Leginon writes entries without a value
    if (entry.key == "RotationAngle") read_rotation(path, line, entry, axes);
    if (part == Part::kOther) continue;
    entries.require_new(path, line, entry, part);
    magnifications.read(line, entry, mdoc);
    if (read_common_entry(path, line, entry, axes, mdoc)) continue;
    if (part == Part::kSection)
      read_section_entry(path, line, entry, &mdoc.sections.back());
    else
      read_head_entry(line, entry, mdoc);
  }
  if (mdoc.sections.empty()) {
    throw Error(fmt::format("'{}' has no sections, [ZValue = 0] and so on: is it an .mdoc file?",
                            path.string()));
  }
  sort_and_require_unique(path, &mdoc);
  require_no_pieces(path, mdoc);
  choose_axis(path, axes, mdoc);
  mdoc.two_directions_line = axes.two_directions_line;
  return mdoc;
}

}  // namespace tomofield::io
