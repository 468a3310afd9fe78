#include "tilt_series/tilt_angles.h"

#include <fmt/format.h>

#include <cmath>

#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

// Beyond this tilt a ray crosses several times the specimen's thickness and would need an ever
// wider margin.
constexpr double kLargestTilt_deg = 80.0;

TiltAngles angles_of_mdoc(const io::Mdoc& mdoc, const std::filesystem::path& path,
                          const io::ImageStack& stack) {
  require_count(mdoc.sections.size(), path, "sections", stack);
  TiltAngles angles{path.string(), {}};
  for (std::size_t i = 0; i < mdoc.sections.size(); ++i) {
    const io::MdocSection& section = mdoc.sections[i];
    if (section.section != static_cast<std::int64_t>(i)) {
      throw Error(fmt::format(
          "'{}', line {}: after {} sections comes [ZValue = {}]; the sections "
          "must be numbered 0 to {} as those of '{}'",
          path.string(), section.line, i, section.section, mdoc.sections.size() - 1, stack.name()));
    }
    angles.of_section.emplace_back();
    if (section.tilt_deg) angles.of_section.back() = {*section.tilt_deg, section.line};
  }
  return angles;
}

TiltAngles angles_of_table(const SectionTable& table) {
  TiltAngles angles{table.source, {}};
  for (const auto& section : table.of_section) {
    angles.of_section.emplace_back();
    if (section) angles.of_section.back() = {section->tilt_deg, section->line};
  }
  return angles;
}

}  // namespace

void require_count(std::size_t found, const std::filesystem::path& file, const char* what,
                   const io::ImageStack& stack) {
  if (static_cast<std::int64_t>(found) == stack.header().nz) return;
  throw Error(
      fmt::format("'{}' has {} {} but the stack '{}' has {} sections; give the file that "
                  "belongs to this stack (sections are left out with --exclude alone)",
                  file.string(), found, what, stack.name(), stack.header().nz));
}

TiltAngles find_tilt_angles(const TiltSeriesOptions& options, const io::ImageStack& stack,
                            const std::optional<SectionTable>& table,
                            const std::optional<io::Mdoc>& mdoc) {
  if (options.tlt) {
    const auto numbers = io::read_number_column(*options.tlt, "a tilt angle in degrees");
    require_count(numbers.size(), *options.tlt, "angles", stack);
    return {options.tlt->string(), {numbers.begin(), numbers.end()}};
  }
  if (table) return angles_of_table(*table);
  if (mdoc) return angles_of_mdoc(*mdoc, *options.mdoc, stack);
  const auto& extended = stack.header().extended_tilt_deg;
  if (extended.empty()) {
    throw Error(
        fmt::format("no tilt angles for '{}': its header has none, so give them with --tlt FILE "
                    "(.tlt or .rawtlt), --aln FILE (AreTomo) or --mdoc FILE (SerialEM)",
                    stack.name()));
  }
  TiltAngles angles{fmt::format("extended header of {}", stack.name()), {}};
  for (const double tilt_deg : extended) angles.of_section.push_back(io::NumberLine{tilt_deg, 0});
  return angles;
}

double require_usable_tilt(const TiltAngles& angles, std::int64_t section) {
  const auto& angle = angles.of_section[static_cast<std::size_t>(section)];
  if (!angle) {
    throw Error(fmt::format("'{}' has no tilt angle for section {}; leave it out with --exclude {}",
                            angles.source, section + 1, section + 1));
  }
  if (!(std::fabs(angle->value) <= kLargestTilt_deg)) {  // also if it is not a number
    const std::string line = angle->line > 0 ? fmt::format(", line {}", angle->line) : "";
    throw Error(
        fmt::format("'{}'{}: the tilt angle {}° of section {} is beyond ±{:.0f}°, which "
                    "cannot be reconstructed; correct it, or leave the section out with "
                    "--exclude {}",
                    angles.source, line, angle->value, section + 1, kLargestTilt_deg, section + 1));
  }
  return angle->value;
}

}  // namespace tomofield::tilt_series
