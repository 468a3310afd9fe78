#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <string>

#include "io/alignment_files.h"
#include "io/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

[[noreturn]] void throw_row_error(const std::filesystem::path& path, const TextLine& line,
                                  std::string_view expected) {
  throw Error(fmt::format("'{}', line {}: '{}' is not {}", path.string(), line.number,
                          quote(line.text), expected));
}

/// Returns the words of a line as finite numbers, or nothing if any word is not one.
std::vector<double> parse_numbers(std::string_view text) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(text)) {
    const auto number = parse_number(word);
    if (!number) return {};
    numbers.push_back(*number);
  }
  return numbers;
}

/// Parses "# name = numbers" and skips comments of any other form.
void parse_header_line(const std::filesystem::path& path, const TextLine& line,
                       AreTomoAlignment* alignment) {
  const std::size_t equals = line.text.find('=');
  if (equals == std::string::npos) return;
  const std::string_view text = line.text;
  const std::string_view name = trim(text.substr(1, equals - 1));
  const std::vector<double> numbers = parse_numbers(text.substr(equals + 1));
  const auto require = [&](std::size_t count) {
    if (numbers.size() < count) {
      throw_row_error(path, line, fmt::format("{} with {} numbers", name, count));
    }
  };
  const auto integer = [&](std::size_t i) { return static_cast<std::int64_t>(numbers[i]); };
  if (name == "RawSize") {
    require(3);
    alignment->raw_size = {integer(0), integer(1), integer(2)};
  } else if (name == "DarkFrame") {
    require(2);
    alignment->dark_sections.push_back(integer(1));
  } else if (name == "AlphaOffset") {
    require(1);
    alignment->alpha_offset_deg = numbers[0];
  } else if (name == "BetaOffset") {
    require(1);
    alignment->beta_offset_deg = numbers[0];
  }
}

AreTomoRow parse_row(const std::filesystem::path& path, const TextLine& line) {
  constexpr std::size_t kColumns = 10;  // SEC ROT GMAG TX TY SMEAN SFIT SCALE BASE TILT
  const std::vector<std::string_view> words = split_words(line.text);
  const auto section = words.empty() ? std::nullopt : parse_integer(words.front());
  // The middle columns are image statistics, which may be nan and are not used.
  std::array<double, 5> used{};
  constexpr std::array<std::size_t, 5> kUsedColumns{1, 2, 3, 4, 9};
  constexpr std::array<double, 5> kLargest{base::kLargestAngle_deg, base::kLargestNumber,
                                           base::kLargestPosition_px, base::kLargestPosition_px,
                                           base::kLargestAngle_deg};
  bool is_valid = words.size() == kColumns && section && *section >= 0;
  for (std::size_t i = 0; is_valid && i < used.size(); ++i) {
    const auto number = parse_number(words[kUsedColumns[i]], kLargest[i]);
    is_valid = number.has_value();
    used[i] = number.value_or(0.0);
  }
  if (!is_valid) {
    throw_row_error(path, line, "a row of AreTomo: SEC ROT GMAG TX TY SMEAN SFIT SCALE BASE TILT");
  }
  return {*section, line.number, used[0], used[1], used[2], used[3], used[4]};
}

/// Returns true if the numbers are exactly first, …, first + count − 1 in some order.
bool are_consecutive(const std::set<std::int64_t>& numbers, std::int64_t first, std::size_t count) {
  return numbers.size() == count && !numbers.empty() && *numbers.begin() == first &&
         *numbers.rbegin() == first + static_cast<std::int64_t>(count) - 1;
}

std::vector<std::int64_t> all_but(const std::vector<std::int64_t>& left_out, std::int64_t offset,
                                  std::int64_t count) {
  std::vector<std::int64_t> kept;
  for (std::int64_t section = 0; section < count; ++section) {
    if (std::find(left_out.begin(), left_out.end(), section + offset) == left_out.end()) {
      kept.push_back(section);
    }
  }
  return kept;
}

}  // namespace

AreTomoAlignment read_aretomo_alignment(const std::filesystem::path& path) {
  AreTomoAlignment alignment;
  bool is_local_part = false;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with('#')) {
      is_local_part = is_local_part || line.text.find("Local Alignment") != std::string::npos;
      parse_header_line(path, line, &alignment);
    } else if (is_local_part) {
      ++alignment.num_local_rows;
    } else {
      alignment.rows.push_back(parse_row(path, line));
    }
  }
  if (alignment.rows.empty()) {
    throw Error(fmt::format("'{}' has no rows of an AreTomo alignment", path.string()));
  }
  return alignment;
}

std::vector<std::int64_t> assign_aretomo_sections(const AreTomoAlignment& alignment,
                                                  const std::filesystem::path& aln,
                                                  std::int64_t num_sections,
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
  std::set<std::int64_t> numbers;
  for (const AreTomoRow& row : rows) numbers.insert(row.section);
  std::set<std::int64_t> with_dark = numbers;
  with_dark.insert(alignment.dark_sections.begin(), alignment.dark_sections.end());
  const auto total = rows.size() + alignment.dark_sections.size();

  // The numbering is from before the removal if rows and dark frames together are complete, and
  // from after it if the rows alone are.
  const bool is_before =
      are_consecutive(with_dark, 0, total) || are_consecutive(with_dark, 1, total);
  const bool is_after =
      are_consecutive(numbers, 0, rows.size()) || are_consecutive(numbers, 1, rows.size());
  if (!is_before && !is_after) {
    throw Error(
        fmt::format("'{}': the section numbers (SEC) of {} rows and {} dark frames are "
                    "neither complete nor each there once, so no section of '{}' can be "
                    "told for them",
                    aln.string(), num_rows, num_dark, stack.string()));
  }
  std::vector<std::int64_t> sections;
  if (is_before && stack_is_complete) {
    for (const AreTomoRow& row : rows) sections.push_back(row.section - *with_dark.begin());
    return sections;
  }
  // Otherwise only the order of the rows counts. In a reduced stack it gives the section directly;
  // in a complete one it gives the place among the sections that are not dark.
  std::vector<std::int64_t> kept(rows.size());
  std::iota(kept.begin(), kept.end(), 0);
  if (stack_is_complete) kept = all_but(alignment.dark_sections, *numbers.begin(), num_sections);
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
