#include "tilt_series/contradictions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "base/log.h"
#include "base/statistics.h"
#include "tilt_series/match_by_tilt.h"

namespace tomofield::tilt_series {
namespace {

// An alignment that refines tilt angles changes them by less.
constexpr double kLargestChange_deg = 3.0;
constexpr double kLargestAxisChange_deg = 10.0;

Angles values_of(const TiltAngles& angles) {
  Angles values;
  for (const auto& angle : angles.of_section)
    values.push_back(angle ? std::optional(angle->value) : std::nullopt);
  return values;
}

std::string name_of_alignment(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  return options.xf ? options.xf->string() : options.aln ? options.aln->string() : stack.name();
}

// Returns the offset that most of the differences share, or 0.
double common_offset(const std::vector<double>& differences) {
  const double median = base::median(differences);
  const auto num_near = std::ranges::count_if(differences, [&](double difference) {
    return std::fabs(difference - median) <= kLargestChange_deg;
  });
  return 2 * num_near > std::ssize(differences) ? median : 0.0;
}

// The sections in which angles differ from others by more than a common offset.
struct OtherAngles {
  std::size_t count = 0, first = 0;  // first: of them
  std::size_t of = 0;                // sections that have both
};

OtherAngles find_other_angles(const Angles& angles, const Angles& others) {
  std::vector<double> differences;
  std::vector<std::size_t> sections;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    if (!angles[i] || !others[i]) continue;
    differences.push_back(*angles[i] - *others[i]);
    sections.push_back(i);
  }
  if (differences.empty()) return {};
  const double offset = common_offset(differences);
  OtherAngles found{.of = differences.size()};
  for (std::size_t i = 0; i < differences.size(); ++i) {
    if (std::fabs(differences[i] - offset) <= kLargestChange_deg) continue;
    if (found.count++ == 0) found.first = sections[i];
  }
  return found;
}

}  // namespace

bool are_other_angles(const Angles& angles, const Angles& others) {
  return find_other_angles(angles, others).count > 0;
}

void warn_of_other_angles(const Angles& angles, const std::string& source, const Angles& others,
                          const std::string& other_source) {
  const OtherAngles found = find_other_angles(angles, others);
  if (found.count == 0) return;
  base::log_warning(fmt::format(
      "the tilt angles of '{}' differ from those of {} in {} of {} sections by more than a common "
      "offset (section {}: {:g}° and {:g}°): are they in the order of the sections?",
      source, other_source, found.count, found.of, found.first + 1, *angles[found.first],
      *others[found.first]));
}

void warn_of_other_angles(const TiltAngles& used, const std::filesystem::path& path,
                          const io::Mdoc& mdoc, const io::ImageStack& stack) {
  if (used.source == path.string()) return;
  Angles others;
  for (const io::MdocSection& section : mdoc.sections) others.push_back(section.tilt_deg);
  if (others.size() == used.of_section.size())
    return warn_of_other_angles(values_of(used), used.source, others,
                                fmt::format("'{}'", path.string()));
  if (match_by_tilt(values_of(used), others)) return;
  base::log_warning(
      fmt::format("'{}' has {} sections and '{}' {}, and their tilts do not say which belong "
                  "together: are they "
                  "of one series?",
                  path.string(), mdoc.sections.size(), stack.name(), stack.header().nz));
}

void warn_of_other_angles(const TiltAngles& used, const io::ImageStack& stack) {
  const auto& extended = stack.header().extended_tilt_deg;
  const bool are_used = used.source == source_of_header(stack);
  if (extended.size() != used.of_section.size() || are_used) return;
  warn_of_other_angles(values_of(used), used.source, Angles(extended.begin(), extended.end()),
                       fmt::format("the header of '{}'", stack.name()));
}

void warn_of_other_angles(const TiltAngles& used, const SectionTable& table) {
  if (used.source == table.source) return;
  Angles others;
  for (const auto& section : table.of_section)
    others.push_back(section ? std::optional(section->tilt_deg) : std::nullopt);
  const bool has_any = std::ranges::any_of(
      others, [](const std::optional<double>& tilt) { return tilt.value_or(0.0) != 0.0; });
  if (has_any)
    warn_of_other_angles(values_of(used), used.source, others, fmt::format("'{}'", table.source));
}

void warn_of_other_nominal_angles(const SectionTable& table) {
  Angles angles;
  for (const auto& section : table.of_section)
    angles.push_back(section ? std::optional(section->tilt_deg) : std::nullopt);
  if (table.nominal_tilt_deg.size() == angles.size())
    warn_of_other_angles(angles, table.source, table.nominal_tilt_deg,
                         "its _rlnTomoNominalStageTiltAngle");
}

void warn_of_two_axes(const StatedAxis& used, const std::optional<StatedAxis>& other) {
  if (!other || used.is_given ||
      angle_between_axes(used.angle_deg, other->angle_deg) <= kLargestAxisChange_deg)
    return;
  base::log_warning(
      fmt::format("{} states a tilt axis of {:.4g}°, and {} of {:.4g}°: the former is "
                  "taken (give the right one with --tilt-axis)",
                  used.source, used.angle_deg, other->source, other->angle_deg));
}

std::optional<std::string> contradiction_of_axis(const StatedAxis& stated, double aligned_axis_deg,
                                                 const std::string& alignment) {
  const double difference_deg = angle_between_axes(stated.angle_deg, aligned_axis_deg);
  if (difference_deg <= kLargestAxisChange_deg) return std::nullopt;
  const bool is_opposite = difference_deg >= 180.0 - kLargestAxisChange_deg;
  return fmt::format("'{}' turns the views by a tilt axis of {:.1f}°, and {} states {:.1f}°: {}",
                     alignment, aligned_axis_deg, stated.source, stated.angle_deg,
                     is_opposite ? "one of the two makes a tomogram that is mirrored in z"
                                 : "are they of one series?");
}

void warn_of_other_axis(const StatedAxis& stated, double aligned_axis_deg,
                        const TiltSeriesOptions& options, const io::ImageStack& stack) {
  if (stated.is_given) return;
  const std::string alignment = name_of_alignment(options, stack);
  if (const auto found = contradiction_of_axis(stated, aligned_axis_deg, alignment))
    base::log_warning(*found);
}

void warn_of_other_line(const StatedAxis& stated, double aligned_axis_deg,
                        const TiltSeriesOptions& options, const io::ImageStack& stack) {
  const double difference_deg = angle_between_axes(stated.angle_deg, aligned_axis_deg);
  if (difference_deg < 180.0 - kLargestAxisChange_deg)
    warn_of_other_axis(stated, aligned_axis_deg, options, stack);
}

void warn_of_turned_views(const Angles& axes_deg, double mean_deg, const TiltSeriesOptions& options,
                          const io::ImageStack& stack) {
  constexpr double kLargestTurn_deg = 20.0;
  std::size_t count = 0, most = 0;
  double largest_deg = 0.0;
  for (std::size_t i = 0; i < axes_deg.size(); ++i) {
    const double turn_deg =
        axes_deg[i] ? std::fabs(std::remainder(*axes_deg[i] - mean_deg, 360.0)) : 0.0;
    if (turn_deg > kLargestTurn_deg) ++count;
    if (turn_deg <= largest_deg) continue;
    largest_deg = turn_deg;
    most = i;
  }
  if (count == 0) return;
  base::log_warning(fmt::format(
      "'{}' turns {} of {} views by another tilt axis than the rest (section {}: {:.1f}°, the mean "
      "is {:.1f}°): is it damaged?",
      name_of_alignment(options, stack), count, axes_deg.size(), most + 1, *axes_deg[most],
      mean_deg));
}

void warn_of_given_axis(double given_deg, const std::optional<StatedAxis>& stated) {
  constexpr double kLargestChangeOfAxis_deg = 3.0;  // alignments refine nominal axes by less
  if (!stated || angle_between_axes(stated->angle_deg, given_deg) <= kLargestChangeOfAxis_deg)
    return;
  base::log_warning(fmt::format(
      "--tilt-axis turns the views by {:.4g}°, and {} states {:.4g}°: the given one is taken",
      given_deg, stated->source, stated->angle_deg));
}

void warn_of_unknown_axis(const io::ImageStack& stack) {
  base::log_warning(fmt::format(
      "no file states the tilt axis of '{}': it is looked for within some degrees of the "
      "vertical; give its direction with --tilt-axis if it may be another one",
      stack.name()));
}

}  // namespace tomofield::tilt_series
