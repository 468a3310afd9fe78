#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>
#include <optional>
#include <set>
#include <string>

#include "io/tables/alignment_files.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using Sections = std::vector<std::int64_t>;

// Returns true if the numbers are exactly first, …, first + count − 1 in some order.
bool are_consecutive(const std::set<std::int64_t>& numbers, std::int64_t first, std::size_t count) {
  return numbers.size() == count && !numbers.empty() && *numbers.begin() == first &&
         *numbers.rbegin() == first + static_cast<std::int64_t>(count) - 1;
}

Sections all_but(const Sections& left_out, std::int64_t offset, std::int64_t count) {
  Sections kept;
  for (std::int64_t section = 0; section < count; ++section) {
    if (std::find(left_out.begin(), left_out.end(), section + offset) == left_out.end()) {
      kept.push_back(section);
    }
  }
  return kept;
}

// AreTomo3 may write 0 for the section of every dark frame, which says nothing.
bool has_unknown_dark_sections(const AreTomoAlignment& alignment) {
  return !alignment.dark_sections.empty() &&
         std::ranges::all_of(alignment.dark_sections, [](std::int64_t s) { return s == 0; }) &&
         alignment.dark_tilt_deg.size() == alignment.dark_sections.size();
}

// Returns the rows in the order of SEC.
Sections rows_by_number(const AreTomoAlignment& alignment) {
  Sections order(alignment.rows.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](std::int64_t row) {
    return alignment.rows[static_cast<std::size_t>(row)].section;
  });
  return order;
}

// Places dark frames among rows whose tilts rise (or fall) with SEC. `offset_deg` is what AreTomo
// has added to the tilts of the rows and not to those of the dark frames. Returns the section of
// each row, or nothing if the tilts do not say where the dark frames are.
std::optional<Sections> place_by_tilt(const AreTomoAlignment& alignment, double offset_deg) {
  const Sections order = rows_by_number(alignment);
  const auto tilt_at = [&](std::size_t rank) {
    return alignment.rows[static_cast<std::size_t>(order[rank])].tilt_deg;
  };
  const double direction = tilt_at(0) <= tilt_at(order.size() - 1) ? 1.0 : -1.0;
  Sections sections(order.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const double tilt_deg = tilt_at(rank);
    if (rank > 0 && !(direction * (tilt_deg - tilt_at(rank - 1)) > 0)) return std::nullopt;
    std::int64_t num_before = 0;
    for (const double dark_deg : alignment.dark_tilt_deg) {
      if (dark_deg + offset_deg == tilt_deg) return std::nullopt;
      if (direction * (dark_deg + offset_deg - tilt_deg) < 0) ++num_before;
    }
    sections[static_cast<std::size_t>(order[rank])] = static_cast<std::int64_t>(rank) + num_before;
  }
  return sections;
}

// Tells whether the tilts of the rows rise, or fall, with SEC, as in AreTomo 3's stacks.
bool are_sorted_by_tilt(const AreTomoAlignment& alignment) {
  std::vector<double> tilts_deg;
  for (const std::int64_t row : rows_by_number(alignment))
    tilts_deg.push_back(alignment.rows[static_cast<std::size_t>(row)].tilt_deg);
  return std::ranges::is_sorted(tilts_deg) ||
         std::ranges::is_sorted(tilts_deg, std::ranges::greater());
}

// Returns the sections of the rows in a complete stack by the places of the dark frames in the
// order of tilt, or nothing if the rows are in another order or the places cannot be.
std::optional<Sections> place_beside_dark(const AreTomoAlignment& alignment) {
  const auto num_sections = std::ssize(alignment.rows) + std::ssize(alignment.dark_sections);
  if (std::ssize(alignment.dark_places) != std::ssize(alignment.dark_sections) ||
      !are_sorted_by_tilt(alignment))
    return std::nullopt;
  const Sections kept = all_but(alignment.dark_places, 0, num_sections);
  if (kept.size() != alignment.rows.size()) return std::nullopt;
  const Sections order = rows_by_number(alignment);
  Sections sections(order.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank)
    sections[static_cast<std::size_t>(order[rank])] = kept[rank];
  return sections;
}

// Returns the sections of the rows in a complete stack, where the numbers of the rows do not tell
// the dark frames.
Sections sections_beside_unknown_dark(const AreTomoAlignment& alignment,
                                      const std::filesystem::path& aln) {
  // It is not said whether the tilts of dark frames include the offset, so both must agree.
  const auto sections = place_by_tilt(alignment, 0.0);
  if (sections && sections == place_by_tilt(alignment, alignment.alpha_offset_deg))
    return *sections;
  if (const auto by_place = place_beside_dark(alignment)) return *by_place;
  throw Error(fmt::format(
      "'{}' has dark frames without their sections, and their tilts do not say where they are "
      "among the rows: give the stack without the dark frames",
      aln.string()));
}

// Returns the places of dark frames in the order of tilt, which are their sections where the
// numbers of the rows are those that are missing among them, counted from 0 or 1. Else returns
// nothing.
std::optional<Sections> dark_sections_by_place(const AreTomoAlignment& alignment,
                                               const std::set<std::int64_t>& numbers) {
  const std::size_t total = alignment.rows.size() + alignment.dark_sections.size();
  if (alignment.dark_places.size() != alignment.dark_sections.size()) return std::nullopt;
  for (const std::int64_t base : {0, 1}) {
    std::set<std::int64_t> all = numbers;
    for (const std::int64_t place : alignment.dark_places) all.insert(place + base);
    if (!are_consecutive(all, base, total)) continue;
    Sections sections = alignment.dark_places;
    for (std::int64_t& section : sections) section += base;
    return sections;
  }
  return std::nullopt;
}

}  // namespace

Sections assign_aretomo_sections(const AreTomoAlignment& alignment,
                                 const std::filesystem::path& aln, std::int64_t num_sections,
                                 const std::filesystem::path& stack) {
  const auto& rows = alignment.rows;
  const auto num_rows = static_cast<std::int64_t>(rows.size());
  const auto num_dark = static_cast<std::int64_t>(alignment.dark_sections.size());
  const bool stack_is_complete = num_rows + num_dark == num_sections;
  const bool stack_is_reduced = num_rows == num_sections;
  if (!stack_is_complete && !stack_is_reduced) {
    throw Error(fmt::format(
        "'{}' has {} aligned sections{} but '{}' has {}; give the stack that AreTomo "
        "aligned",
        aln.string(), num_rows, num_dark > 0 ? fmt::format(" and {} dark ones", num_dark) : "",
        stack.string(), num_sections));
  }
  for (const Sections& dark : {alignment.dark_places, alignment.dark_sections})
    for (const std::int64_t section : dark)
      if (section < 0 || section > num_rows + num_dark)
        throw Error(
            fmt::format("'{}' has a dark frame {}, and {} sections with the dark ones: "
                        "correct it",
                        aln.string(), section, num_rows + num_dark));
  std::set<std::int64_t> numbers;
  for (const AreTomoRow& row : rows) numbers.insert(row.section);
  Sections dark_sections = alignment.dark_sections;
  bool has_unknown_dark = has_unknown_dark_sections(alignment);
  if (has_unknown_dark) {
    if (const auto found = dark_sections_by_place(alignment, numbers)) {
      dark_sections = *found;
      has_unknown_dark = false;
    }
  }
  if (has_unknown_dark && stack_is_complete && numbers.size() == rows.size())
    return sections_beside_unknown_dark(alignment, aln);
  std::set<std::int64_t> with_dark = numbers;
  with_dark.insert(dark_sections.begin(), dark_sections.end());
  const auto total = rows.size() + alignment.dark_sections.size();

  // The numbering is from before the removal if rows and dark frames together are complete, and
  // from after it if the rows alone are.
  const bool is_before =
      are_consecutive(with_dark, 0, total) || are_consecutive(with_dark, 1, total);
  const bool is_after =
      are_consecutive(numbers, 0, rows.size()) || are_consecutive(numbers, 1, rows.size());
  const bool is_ranked = has_unknown_dark && numbers.size() == rows.size();
  if (!is_before && !is_after && !is_ranked) {
    throw Error(
        fmt::format("'{}': the section numbers (SEC) of {} rows and {} dark frames are "
                    "neither complete nor each there once, so no section of '{}' can be "
                    "told for them",
                    aln.string(), num_rows, num_dark, stack.string()));
  }
  Sections sections;
  if (is_before && stack_is_complete) {
    for (const AreTomoRow& row : rows) sections.push_back(row.section - *with_dark.begin());
    return sections;
  }
  // Otherwise only the order of the rows counts. In a reduced stack it gives the section directly;
  // in a complete one it gives the place among the sections that are not dark.
  Sections kept(rows.size());
  std::iota(kept.begin(), kept.end(), 0);
  if (stack_is_complete) kept = all_but(dark_sections, *numbers.begin(), num_sections);
  if (kept.size() != rows.size()) {
    throw Error(
        fmt::format("'{}': the numbers of the dark frames do not fit the {} sections of '{}'",
                    aln.string(), num_sections, stack.string()));
  }
  for (const AreTomoRow& row : rows) {
    const auto rank = std::distance(numbers.begin(), numbers.find(row.section));
    sections.push_back(kept[static_cast<std::size_t>(rank)]);
  }
  return sections;
}

}  // namespace tomofield::io
