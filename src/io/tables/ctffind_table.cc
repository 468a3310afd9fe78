#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include "io/saving/atomic_file.h"
#include "io/tables/ctf_table.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

// CTFFIND's text (cisTEM, src/programs/ctffind/ctffind.cpp; version 5 adds columns 8 to 10; its
// first line names the program) and AreTomo's (CSaveCtfResults.cpp, to which version 3 adds the
// hand as column 8; CLoadMain.cpp sorts the sections by tilt before) have the same first columns:
// number, defocus 1 and 2 in Å, the direction of defocus 1 in degrees, phase shift in radians.

namespace tomofield::io {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr std::int64_t kMostSections = 100000;

// Returns the number that follows a key of a comment, as in "acceleration voltage: 300.0 keV".
// Returns nothing without the key. Throws Error if no number follows it, or another unit.
std::optional<double> number_after(const std::filesystem::path& path, const TextLine& line,
                                   std::string_view key, std::string_view unit) {
  const std::string_view text = line.text;
  const std::size_t at = text.find(key);
  if (at == std::string_view::npos) return std::nullopt;
  const auto words = split_words(text.substr(at + key.size()));
  const auto number = words.empty() ? std::nullopt : parse_number(words.front());
  if (!number)
    throw Error(fmt::format("'{}', line {}: no number that can be follows '{}'", path.string(),
                            line.number, key));
  const bool has_unit = !unit.empty() && words.size() > 1 && words[1] != ";";
  if (!has_unit || words[1] == unit || (unit == "keV" && words[1] == "kV")) return *number;
  throw Error(fmt::format("'{}', line {}: '{}' is in '{}', and CTFFIND writes {}: correct it",
                          path.string(), line.number, key, words[1], unit));
}

// Throws Error if a comment states another unit of a column than the one that is read, or another
// meaning: "#2 - defocus 1 [Angstroms]; #3 - defocus 2", "#5 - additional phase shift [radians]".
void require_unit(const std::filesystem::path& path, const TextLine& line, std::string_view column,
                  std::string_view letters) {
  std::string_view text = line.text;
  const std::size_t at = text.find(column);
  if (at == std::string_view::npos) return;
  text.remove_prefix(at + column.size());
  const std::string_view stated = trim(text.substr(0, text.find_first_of(";,#")));
  std::string_view unit = stated;
  unit.remove_prefix(std::min(unit.find_first_not_of("[( "), unit.size()));
  if (unit.starts_with("in ")) unit.remove_prefix(3);
  if (stated.empty() || unit.starts_with(letters) || (letters == "A" && unit.starts_with("Å")))
    return;
  throw Error(
      fmt::format("'{}', line {}: the column '{}' is {}, and CTFFIND writes [{}…]: correct it",
                  path.string(), line.number, column, quote(stated), letters));
}

void read_comment(const std::filesystem::path& path, const TextLine& line, StatedOptics& optics) {
  const auto take = [&](std::string_view key, std::string_view unit, std::optional<double>& value) {
    const auto number = number_after(path, line, key, unit);
    if (!number) return;
    if (value && *value != *number)
      throw Error(fmt::format("'{}', line {}: '{}' is {}, and {} in a line before: leave one out",
                              path.string(), line.number, key, *number, *value));
    value = number;
  };
  require_unit(path, line, "defocus 1", "A");
  require_unit(path, line, "defocus 2", "A");
  require_unit(path, line, "azimuth of astigmatism", "deg");
  require_unit(path, line, "phase shift", "rad");
  take("Pixel size:", "Angstroms", optics.pixel_size_A);
  take("acceleration voltage:", "keV", optics.voltage_kV);
  take("spherical aberration:", "mm", optics.spherical_aberration_mm);
  take("amplitude contrast:", "", optics.amplitude_contrast);
}

struct Row {
  std::int64_t section = 0;  // from 0
  Defocus defocus;
};

Row parse_row(const std::filesystem::path& path, const TextLine& line) {
  constexpr std::array kLargest{double(kMostSections), kLargestDefocus_A, kLargestDefocus_A,
                                base::kLargestAngle_deg, 10.0};
  const auto words = split_words(line.text);
  std::array<double, kLargest.size()> values{};
  // The quality of the fit follows. It may be inf or nan and is not used.
  bool is_valid = words.size() >= kLargest.size() + 2;
  for (std::size_t i = 0; is_valid && i < values.size(); ++i) {
    const auto value = parse_number(words[i], kLargest[i]);
    if (!value && parse_number(words[i]))
      throw Error(fmt::format("'{}', line {}: column {} is {}, and a number up to {:g} is expected",
                              path.string(), line.number, i + 1, words[i], kLargest[i]));
    is_valid = value.has_value();
    values[i] = value ? double{*value} : 0.0;
  }
  const auto [number, u_A, v_A, angle_deg, phase_rad] = values;
  if (!is_valid || number < 1 || number != std::floor(number)) {
    throw Error(fmt::format(
        "'{}', line {}: '{}' is not a row of CTFFIND or AreTomo: number of the micrograph, defocus "
        "1 and 2 in Å, azimuth in degrees, phase shift in radians, correlation, resolution",
        path.string(), line.number, quote(line.text)));
  }
  return {static_cast<std::int64_t>(number) - 1, {u_A, v_A, angle_deg, phase_rad / kRadians}};
}

}  // namespace

CtfTable read_ctffind(const std::filesystem::path& path) {
  CtfTable table{path, {}, {}, {}};
  table.is_of_aretomo = true;
  std::optional<double> stated_count;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with('#')) {
      if (line.text.find("CTFFind") != std::string::npos) table.is_of_aretomo = false;
      read_comment(path, line, table.optics);
      if (const auto number = number_after(path, line, "Number of micrographs:", ""))
        stated_count = number;
      continue;
    }
    const Row row = parse_row(path, line);
    const auto section = static_cast<std::size_t>(row.section);
    if (section >= table.views.size()) table.views.resize(section + 1);
    if (table.views[section]) {
      throw Error(fmt::format("'{}', line {}: micrograph {} comes twice", path.string(),
                              line.number, section + 1));
    }
    table.views[section] = row.defocus;
  }
  if (stated_count && *stated_count < static_cast<double>(table.views.size()))
    throw Error(
        fmt::format("'{}' states {} micrographs and has a row of number {}: give the whole "
                    "table of one series, or correct the number",
                    path.string(), *stated_count, table.views.size()));
  return table;
}

void write_ctffind(const std::filesystem::path& path, std::span<const WrittenCtf> sections,
                   const StatedOptics& optics, double pixel_size_A) {
  std::string text = fmt::format(
      "# Output from tomofield simulate, in the form of CTFFind version 4\n"
      "# Number of micrographs: {}\n"
      "# Pixel size: {:.3f} Angstroms ; acceleration voltage: {:.1f} keV ; spherical aberration: "
      "{} mm ; amplitude contrast: {}\n"
      "# Columns: #1 - micrograph number; #2 - defocus 1 [Angstroms]; #3 - defocus 2; #4 - azimuth "
      "of astigmatism; #5 - additional phase shift [radians]; #6 - cross correlation; #7 - spacing "
      "(in Angstroms) up to which CTF rings were fit successfully\n",
      sections.size(), pixel_size_A, optics.voltage_kV.value(),
      optics.spherical_aberration_mm.value(), optics.amplitude_contrast.value());
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const Defocus& defocus = sections[i].defocus;
    text += fmt::format("{}.000000 {:.6f} {:.6f} {:.6f} {:.6f} 1.000000 {:.6f}\n", i + 1,
                        defocus.u_A, defocus.v_A, defocus.angle_deg,
                        kRadians * defocus.phase_shift_deg, 2 * pixel_size_A);
  }
  write_text_file(path, text);
}

}  // namespace tomofield::io
