#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "base/statistics.h"
#include "io/tables/alignment_files.h"

// This file finds what an .mdoc tells of a session beside its geometry: the order of recording, and
// the defocus that it aimed at.

namespace tomofield::io {
namespace {

// Returns the order of sections by a key, if all have it and no two are equal.
template <typename Key>
std::optional<std::vector<std::size_t>> order_by(const std::vector<MdocSection>& sections,
                                                 std::optional<Key> MdocSection::*key) {
  std::vector<std::size_t> order(sections.size());
  std::iota(order.begin(), order.end(), 0);
  if (!std::ranges::all_of(sections, [&](const MdocSection& s) { return (s.*key).has_value(); }))
    return std::nullopt;
  const auto value = [&](std::size_t i) { return *(sections[i].*key); };
  std::ranges::sort(order, {}, value);
  const bool is_unique = std::ranges::adjacent_find(order, {}, value) == order.end();
  return is_unique ? std::optional(order) : std::nullopt;
}

// Returns why the times give no order: AcquisitionOrder::fault_of_times.
std::string fault_of_times(const std::vector<MdocSection>& sections) {
  std::map<std::int64_t, std::int64_t> section_at;  // by its time
  std::optional<std::int64_t> untimed;
  std::string fault;
  for (const MdocSection& section : sections) {
    if (section.unread_time_line > 0)
      return fmt::format("line {}: DateTime is not a date and a time such as 12-Mar-21 15:31:02",
                         section.unread_time_line);
    if (!section.time_s) {
      untimed = untimed.value_or(section.section);
      continue;
    }
    const auto [other, is_new] = section_at.emplace(*section.time_s, section.section);
    if (!is_new && fault.empty())
      fault = fmt::format("[ZValue = {}] and [ZValue = {}] have the same DateTime", other->second,
                          section.section);
  }
  if (section_at.empty()) return "";
  if (untimed) return fmt::format("[ZValue = {}] has no DateTime", *untimed);
  return fault;
}

// Tells whether the tilts rise or fall from section to section.
bool are_sorted(const std::vector<MdocSection>& sections) {
  const auto tilt = [](const MdocSection& section) { return section.tilt_deg.value_or(0.0); };
  return std::ranges::is_sorted(sections, {}, tilt) ||
         std::ranges::is_sorted(sections, std::ranges::greater{}, tilt);
}

}  // namespace

std::optional<double> target_underfocus_um(const Mdoc& mdoc) {
  std::vector<double> underfocus_um;
  for (const MdocSection& section : mdoc.sections)
    if (section.target_defocus_um) underfocus_um.push_back(-*section.target_defocus_um);
  if (underfocus_um.empty()) return std::nullopt;
  const double target_um = base::median(std::move(underfocus_um));
  return target_um > 0.0 ? std::optional(target_um) : std::nullopt;
}

AcquisitionOrder acquisition_order(const Mdoc& mdoc) {
  if (auto by_time = order_by(mdoc.sections, &MdocSection::time_s)) return {*by_time, true, ""};
  if (auto by_dose = order_by(mdoc.sections, &MdocSection::prior_dose)) return {*by_dose, true, ""};
  AcquisitionOrder as_numbered{.sections = std::vector<std::size_t>(mdoc.sections.size()),
                               .fault_of_times = fault_of_times(mdoc.sections)};
  std::iota(as_numbered.sections.begin(), as_numbered.sections.end(), 0);
  if (as_numbered.fault_of_times.empty() && mdoc.two_directions_line > 0 &&
      are_sorted(mdoc.sections))
    as_numbered.fault_of_times = fmt::format(
        "line {}: the title states two directions of tilting, the sections are sorted "
        "by tilt and have no DateTime",
        mdoc.two_directions_line);
  return as_numbered;
}

}  // namespace tomofield::io
