#include "tilt_series/tilt_angles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/log.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

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

// Says that angles of sections, counted from 1, are not numbers.
std::string describe_unusable(const TiltAngles& angles, const std::vector<std::int64_t>& sections) {
  const bool is_one = sections.size() == 1;
  return fmt::format(
      "'{0}': the tilt angle{1} of section{1} {2} {3} not a finite number; correct {4}, or leave "
      "the "
      "section{1} out with --exclude {2}",
      angles.source, is_one ? "" : "s", io::section_list(sections), is_one ? "is" : "are",
      is_one ? "it" : "them");
}

// Describes sections, counted from 1, that are tilted too far.
std::string describe_steep(const TiltAngles& angles, const std::vector<std::int64_t>& steep,
                           double offset_deg) {
  std::vector<std::string> texts;
  for (const std::int64_t section : steep) {
    const io::NumberLine& angle = *angles.of_section[static_cast<std::size_t>(section - 1)];
    texts.push_back(fmt::format("{}° of section {}{}", angle.value, section,
                                angle.line > 0 ? fmt::format(" (line {})", angle.line) : ""));
  }
  const bool is_one = steep.size() == 1;
  return fmt::format(
      "'{}': the tilt angle{} {}{} {} beyond ±{:.0f}°, which cannot be reconstructed; correct {}, "
      "or leave the section{} out with --exclude {}",
      angles.source, is_one ? "" : "s", fmt::join(texts, ", "),
      offset_deg == 0.0 ? "" : fmt::format(", with the {:.6g}° of --tilt-offset,", offset_deg),
      is_one ? "is" : "are", base::kLargestTilt_deg, is_one ? "it" : "them", is_one ? "" : "s",
      io::section_list(steep));
}

void require_different(const TiltAngles& angles, std::span<const std::int64_t> sections,
                       const io::ImageStack& stack) {
  constexpr double kLeastSpan_deg = 0.1;       // stages are less exact
  constexpr double kLeastUsualSpan_deg = 3.2;  // a series in radians spans less
  constexpr std::size_t kFewestViews = 5;
  if (sections.size() == 1)
    return base::log_warning(fmt::format("'{}': section {} alone is used, which is no tilt series",
                                         stack.name(), sections.front() + 1));
  const auto [low, high] = std::ranges::minmax(sections, {}, [&](std::int64_t section) {
    return angles.of_section[static_cast<std::size_t>(section)]->value;
  });
  const double lowest = angles.of_section[static_cast<std::size_t>(low)]->value;
  const double highest = angles.of_section[static_cast<std::size_t>(high)]->value;
  const double span_deg = highest - lowest;
  if (span_deg < kLeastSpan_deg) {
    throw Error(fmt::format(
        "'{}': the tilts of all {} sections are {:.6g}°{}, which is no tilt series: give {}",
        angles.source, sections.size(), lowest + 0.0,
        highest > lowest ? fmt::format(" to {:.6g}°", highest) : "",
        stack.is_in_memory() ? "the tilt angles" : "the file of the tilt angles with --tlt"));
  }
  if (span_deg < kLeastUsualSpan_deg && sections.size() >= kFewestViews) {
    base::log_warning(fmt::format(
        "'{}': the tilts reach from {:.6g}° to {:.6g}° only: give degrees, if these are radians",
        angles.source, lowest, highest));
  }
}

}  // namespace

std::string source_of_header(const io::ImageStack& stack) {
  if (stack.is_in_memory()) return fmt::format("tilt angles of {}", stack.name());
  return fmt::format("extended header of {}", stack.name());
}

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
    const auto numbers = io::read_tilt_table(*options.tlt).angles;
    require_count(numbers.size(), *options.tlt, "angles", stack);
    return {options.tlt->string(), {numbers.begin(), numbers.end()}};
  }
  if (table) return angles_of_table(*table);
  const auto& extended = stack.header().extended_tilt_deg;
  // The .mdoc of the whole series, beside a stack from which sections were cut, has more sections.
  const bool is_of_others = mdoc && std::ssize(mdoc->sections) != stack.header().nz;
  if (mdoc && (!is_of_others || extended.empty()))
    return angles_of_mdoc(*mdoc, *options.mdoc, stack);
  if (extended.empty()) {
    throw Error(fmt::format(
        "no tilt angles for '{}': its header has {}, so give them with --tlt FILE "
        "(.tlt or .rawtlt), --aln FILE (AreTomo) or --mdoc FILE (SerialEM)",
        stack.name(),
        stack.header().differences.empty() ? "none" : stack.header().differences.front()));
  }
  TiltAngles angles{source_of_header(stack), {}};
  for (const double tilt_deg : extended) angles.of_section.push_back(io::NumberLine{tilt_deg, 0});
  return angles;
}

void require_usable_tilts(const TiltAngles& angles, double offset_deg,
                          std::span<const std::int64_t> sections, const io::ImageStack& stack) {
  std::vector<std::int64_t> missing, unusable, steep;
  for (const std::int64_t section : sections) {
    const auto& angle = angles.of_section[static_cast<std::size_t>(section)];
    if (!angle)
      missing.push_back(section + 1);
    else if (!std::isfinite(angle->value))
      unusable.push_back(section + 1);
    else if (std::fabs(angle->value) > base::kLargestTilt_deg)
      steep.push_back(section + 1);
  }
  if (!missing.empty()) {
    throw Error(
        fmt::format("'{0}' has no tilt angle for section{1} {2}; leave {3} out with --exclude "
                    "{2}",
                    angles.source, missing.size() == 1 ? "" : "s", io::section_list(missing),
                    missing.size() == 1 ? "it" : "them"));
  }
  if (!unusable.empty()) throw Error(describe_unusable(angles, unusable));
  if (!steep.empty()) throw Error(describe_steep(angles, steep, offset_deg));
  require_different(angles, sections, stack);
}

}  // namespace tomofield::tilt_series
