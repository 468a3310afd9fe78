#include "measurement/section_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>

#include "base/log.h"
#include "io/images/view_images.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "tilt_series/contradictions.h"
#include "tilt_series/match_by_tilt.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

// Returns the rows by the sections of AreTomo's alignment, which leaves dark frames out, or nothing
// if it has another number of rows.
std::optional<RowOfSection> rows_by_aretomo(const Sections& sections, const RowsOfViews& table) {
  if (!sections.input.aln) return std::nullopt;
  const auto alignment = io::read_aretomo_alignment(*sections.input.aln, /*needs_tilt=*/false);
  if (alignment.rows.size() != table.count) return std::nullopt;
  const auto assigned =
      io::assign_aretomo_sections(alignment, *sections.input.aln, sections.count, sections.stack);
  RowOfSection rows(static_cast<std::size_t>(sections.count));
  for (std::size_t row = 0; row < table.count; ++row)
    rows[static_cast<std::size_t>(assigned[row])] = row;
  return rows;
}

// Returns the rows of AreTomo's table without its alignment: they are sorted by tilt. Nothing if
// the sections are, too. Throws Error for views in another order whose tilts are not all known.
std::optional<RowOfSection> rows_by_rank(const Sections& sections, const RowsOfViews& table) {
  const auto& tilts = sections.tilt_deg;
  std::vector<double> known;
  for (const auto& tilt : tilts)
    if (tilt) known.push_back(*tilt);
  if (std::ranges::is_sorted(known)) return std::nullopt;
  if (known.size() < tilts.size())
    throw Error(fmt::format(
        "the rows of '{}' count as those of AreTomo, which sorts the views by tilt, and '{}' has "
        "another order and views that are left out: give AreTomo's alignment with --aln (--ctf "
        "none "
        "goes on without the table)",
        table.file.string(), sections.stack));
  std::vector<std::size_t> by_tilt(tilts.size());
  std::iota(by_tilt.begin(), by_tilt.end(), std::size_t{0});
  std::ranges::stable_sort(by_tilt, {}, [&](std::size_t i) { return *tilts[i]; });
  RowOfSection rows(tilts.size());
  for (std::size_t row = 0; row < by_tilt.size(); ++row) rows[by_tilt[row]] = row;
  base::log_warning(fmt::format(
      "the rows of '{}' count as those of AreTomo, which sorts the views by tilt, since no line of "
      "it names CTFFIND: '{}' has another order",
      table.file.string(), sections.stack));
  return rows;
}

// An image as a table or a stack names it: without folders and endings, which programs change.
struct ImageKey {
  std::string stem;
  std::optional<std::int64_t> section;  // of a stack

  explicit ImageKey(const std::string& name) {
    const io::ImageInFile image = io::parse_image_name(name);
    stem = image.file.stem().string();
    section = image.section;
  }
  bool operator==(const ImageKey&) const = default;
};

// Returns the row for each section by a comparison of their keys; nothing if a section that is used
// has no row, or several.
template <typename IsSame>
std::optional<RowOfSection> rows_by_key(const Sections& sections, const std::vector<ImageKey>& rows,
                                        const IsSame& is_same) {
  RowOfSection found(static_cast<std::size_t>(sections.count));
  for (std::size_t i = 0; i < found.size(); ++i) {
    const ImageKey key(sections.images[i]);
    for (std::size_t row = 0; row < rows.size(); ++row) {
      if (!is_same(key, rows[row])) continue;
      if (found[i]) return std::nullopt;
      found[i] = row;
    }
    if (!found[i] && sections.tilt_deg[i]) return std::nullopt;
  }
  return found;
}

// Returns the rows by the images that they name. Sections of a stack of another name count by their
// numbers, with a warning. Nothing if the names do not tell.
std::optional<RowOfSection> rows_by_image(const Sections& sections, const RowsOfViews& table) {
  if (sections.images.empty() || table.images.empty() || table.images.size() != table.count)
    return std::nullopt;
  const std::vector<ImageKey> keys(table.images.begin(), table.images.end());
  if (const auto rows = rows_by_key(sections, keys, std::equal_to{})) return rows;
  const auto is_of_first = [&](const ImageKey& key) {
    return key.section && key.stem == keys.front().stem;
  };
  const bool is_one_stack =
      std::ranges::all_of(keys, is_of_first) && ImageKey(sections.images.front()).section;
  auto rows =
      is_one_stack
          ? rows_by_key(sections, keys,
                        [](const ImageKey& a, const ImageKey& b) { return a.section == b.section; })
          : std::nullopt;
  base::log_warning(
      fmt::format("'{}' is of other images ('{}') than '{}' and has no tilts: its rows count {}",
                  table.file.string(), io::quote(table.images.front()), sections.stack,
                  rows ? "by the numbers of the images" : "in their order"));
  return rows;
}

// Returns the rows by tilt, or nothing if the tilts do not tell.
std::optional<RowOfSection> rows_by_tilt(const Sections& sections, const RowsOfViews& table) {
  if (table.tilt_deg.empty()) return std::nullopt;
  return tilt_series::match_by_tilt(sections.tilt_deg, table.tilt_deg);
}

// Returns the rows of a table that has one a section. They are in the order of the sections, unless
// their tilts are those of the sections in another order.
RowOfSection rows_of_whole_table(const Sections& sections, const RowsOfViews& table) {
  RowOfSection rows(table.count);
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  if (table.tilt_deg.size() != table.count ||
      !tilt_series::are_other_angles(sections.tilt_deg, table.tilt_deg))
    return rows;
  auto negated = table.tilt_deg;  // another sign of the tilts is no other order
  for (auto& tilt_deg : negated)
    if (tilt_deg) *tilt_deg = -*tilt_deg;
  const bool has_other_sign = !tilt_series::are_other_angles(sections.tilt_deg, negated);
  const auto by_tilt = has_other_sign ? std::nullopt : rows_by_tilt(sections, table);
  if (by_tilt) {
    const std::string text = fmt::format(
        "'{}' lists the views in another order than '{}': its rows are matched by their tilts",
        table.file.string(), sections.stack);
    if (table.is_ctf)
      base::log_warning(text + "; check that the angles in use are in the order of the sections");
    else
      base::log_info(text);
    return *by_tilt;
  }
  if (table.is_ctf)
    tilt_series::warn_of_other_angles(sections.tilt_deg, sections.stack, table.tilt_deg,
                                      fmt::format("'{}'", table.file.string()));
  return rows;
}

}  // namespace

RowOfSection rows_of_sections(const Sections& sections, const RowsOfViews& table) {
  const bool has_tilts =
      std::ranges::any_of(table.tilt_deg, [](const auto& tilt) { return tilt.has_value(); });
  if (!has_tilts)
    if (const auto rows = rows_by_image(sections, table)) return *rows;
  const bool is_whole = static_cast<std::int64_t>(table.count) == sections.count;
  if (!is_whole || table.is_of_aretomo)
    if (const auto rows = rows_by_aretomo(sections, table)) return *rows;
  if (is_whole && table.is_of_aretomo)
    if (const auto rows = rows_by_rank(sections, table)) return *rows;
  if (is_whole) return rows_of_whole_table(sections, table);
  if (const auto rows = rows_by_tilt(sections, table)) {
    base::log_info(
        fmt::format("'{}' has {} rows and '{}' {} sections: they are matched by their tilts",
                    table.file.string(), table.count, sections.stack, sections.count));
    return *rows;
  }
  throw Error(fmt::format(
      "'{}' has the {} of {} sections, but '{}' has {}, and {}: give the file of this stack{}",
      table.file.string(), table.is_ctf ? "contrast transfer" : "doses", table.count,
      sections.stack, sections.count,
      table.tilt_deg.empty() ? "it has no tilts to tell which belong together"
                             : "their tilts do not tell which belong together",
      table.is_ctf ? " (--ctf none goes on without it)" : ""));
}

}  // namespace tomofield::measurement
