#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

[[noreturn]] void throw_row_error(const std::filesystem::path& path, const TextLine& line,
                                  std::string_view expected) {
  throw Error(fmt::format("'{}', line {}: '{}' is not {}", path.string(), line.number,
                          quote(line.text), expected));
}

// Returns the words of a line as finite numbers, or nothing if any word is not one.
std::vector<double> parse_numbers(std::string_view text) {
  std::vector<double> numbers;
  for (const std::string_view word : split_words(text)) {
    const auto number = parse_number(word);
    if (!number) return {};
    numbers.push_back(*number);
  }
  return numbers;
}

// Holds the numbers that the header states of the whole file, by their names.
using StatedNumbers = std::map<std::string, std::vector<double>, std::less<>>;

// Parses "# name = numbers" and skips comments of any other form.
void parse_header_line(const std::filesystem::path& path, const TextLine& line,
                       StatedNumbers& stated, AreTomoAlignment* alignment) {
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
  const auto integer = [&](std::size_t i) {
    const auto whole = static_cast<std::int64_t>(numbers[i]);
    if (static_cast<double>(whole) != numbers[i])
      throw_row_error(path, line, fmt::format("{} with whole numbers", name));
    return whole;
  };
  constexpr std::array<std::string_view, 5> kOfFile{"RawSize", "NumPatches", "AlphaOffset",
                                                    "BetaOffset", "Thickness"};
  if (std::ranges::find(kOfFile, name) != kOfFile.end()) {
    const auto [other, is_new] = stated.emplace(name, numbers);
    if (!is_new && other->second != numbers)
      throw_row_error(path, line, fmt::format("the {} that a line before states", name));
  }
  if (name == "RawSize") {
    require(3);
    alignment->raw_size = {integer(0), integer(1), integer(2)};
  } else if (name == "NumPatches") {
    require(1);
    alignment->num_patches = integer(0);
  } else if (name == "DarkFrame") {
    require(2);
    alignment->dark_places.push_back(integer(0));
    alignment->dark_sections.push_back(integer(1));
    if (numbers.size() > 2) alignment->dark_tilt_deg.push_back(numbers[2]);
  } else if (name == "AlphaOffset") {
    require(1);
    alignment->alpha_offset_deg = numbers[0];
  } else if (name == "BetaOffset") {
    require(1);
    alignment->beta_offset_deg = numbers[0];
  } else if (name == "Thickness") {
    require(1);
    if (numbers[0] < 0) throw_row_error(path, line, "a thickness of 0 (unknown) or more");
    if (numbers[0] > 0) alignment->thickness = numbers[0];
  }
}

// The columns of a row that are used. The others are image statistics, which may be nan.
struct Column {
  std::string_view name;
  std::size_t index;
  base::Interval within;
};
constexpr base::Interval kMagnifications{0.01, 100.0};
constexpr std::array<Column, 5> kUsedColumns{{{"ROT", 1, base::kLargestAngle_deg},
                                              {"GMAG", 2, kMagnifications},
                                              {"TX", 3, base::kLargestPosition_px},
                                              {"TY", 4, base::kLargestPosition_px},
                                              {"TILT", 9, base::kLargestAngle_deg}}};

// Parses a row. Without `needs_tilt` a tilt that cannot be is 0.
AreTomoRow parse_row(const std::filesystem::path& path, const TextLine& line, bool needs_tilt) {
  constexpr std::size_t kColumns = 10;  // SEC ROT GMAG TX TY SMEAN SFIT SCALE BASE TILT
  const std::vector<std::string_view> words = split_words(line.text);
  const auto section = words.empty() ? std::nullopt : parse_integer(words.front());
  if (words.size() != kColumns || !section || *section < 0) {
    throw_row_error(path, line, "a row of AreTomo: SEC ROT GMAG TX TY SMEAN SFIT SCALE BASE TILT");
  }
  std::array<double, kUsedColumns.size()> used{};
  for (std::size_t i = 0; i < used.size(); ++i) {
    const auto& [name, index, within] = kUsedColumns[i];
    const auto number = parse_number(words[index], within);
    if (!number && (needs_tilt || name != "TILT")) {
      throw Error(
          fmt::format("'{}', line {}: the column {} of AreTomo's row is '{}', and a number from "
                      "{:g} to {:g} is "
                      "expected{}",
                      path.string(), line.number, name, words[index], within.low(), within.high(),
                      name == "TILT" ? ": correct it, or give the angles with --tlt" : ""));
    }
    used[i] = number ? double{*number} : 0.0;
  }
  return {*section, line.number, used[0], used[1], used[2], used[3], used[4]};
}

// The rows of the local alignment that were read: how many, of each row of the global one, and the
// last line.
struct PatchRows {
  std::vector<std::int64_t> counts;
  int last_line = 0;
};

// Throws Error unless each row of the global alignment has as many rows of the local one as the
// file states, if it does.
void require_all_patches(const std::filesystem::path& path, const AreTomoAlignment& alignment,
                         const PatchRows& rows, bool is_stated) {
  if (alignment.num_patches <= 0) {
    if (!rows.counts.empty() && is_stated)
      throw Error(fmt::format(
          "'{}', line {}: a row of the local alignment, and '# NumPatches = {}' states none: write "
          "the right number, or delete the lines from '# Local Alignment' on",
          path.string(), rows.last_line, alignment.num_patches));
    return;
  }
  if (rows.counts.empty())
    throw Error(fmt::format(
        "'{}' has no rows of the local alignment, and '# NumPatches = {}' states as many for each "
        "view: take a whole copy of the file, or write '# NumPatches = 0' to do without it",
        path.string(), alignment.num_patches));
  for (std::size_t t = 0; t < rows.counts.size(); ++t) {
    if (rows.counts[t] == alignment.num_patches) continue;
    throw Error(fmt::format(
        "'{}', which ends at line {}, has {} row{} of the local alignment of view {}, and "
        "'# NumPatches = {}' states as many for each: take a whole copy of the file, or write "
        "'# NumPatches = 0' and delete the lines from '# Local Alignment' on to do without it",
        path.string(), rows.last_line, rows.counts[t], rows.counts[t] == 1 ? "" : "s", t,
        alignment.num_patches));
  }
}

// Adds a row "t p x y dx dy good" of the local alignment, where t counts the rows of the global
// one.
void add_patch(const std::filesystem::path& path, const TextLine& line, AreTomoAlignment& alignment,
               PatchRows& rows) {
  constexpr std::size_t kColumns = 7;
  const auto words = split_words(line.text);
  const auto row = words.size() == kColumns ? parse_integer(words[0]) : std::nullopt;
  if (!row || *row < 0 || *row >= std::ssize(alignment.rows))
    throw_row_error(
        path, line,
        fmt::format("a row of AreTomo's local alignment of {} views: t p x y dx dy good",
                    alignment.rows.size()));
  alignment.patches.resize(alignment.rows.size());
  rows.counts.resize(alignment.rows.size());
  ++rows.counts[static_cast<std::size_t>(*row)];
  rows.last_line = line.number;
  const auto good = parse_number(words[6]);
  if (!good) throw_row_error(path, line, "a row of the local alignment, whose flag is a number");
  if (*good < 0.9) return;  // as AreTomo does; such a row may have nan
  std::array<double, 4> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto number = parse_number(words[2 + i], base::kLargestPosition_px);
    if (!number) throw_row_error(path, line, "a row of AreTomo's local alignment");
    numbers[i] = *number;
  }
  alignment.patches[static_cast<std::size_t>(*row)].push_back(
      {numbers[0], numbers[1], numbers[2], numbers[3]});
}

}  // namespace

AreTomoAlignment read_aretomo_alignment(const std::filesystem::path& path, bool needs_tilt) {
  AreTomoAlignment alignment;
  PatchRows patch_rows;
  StatedNumbers stated;
  bool is_local_part = false;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with('#')) {
      is_local_part = is_local_part || line.text.find("Local Alignment") != std::string::npos;
      parse_header_line(path, line, stated, &alignment);
    } else if (is_local_part) {
      add_patch(path, line, alignment, patch_rows);
    } else {
      alignment.rows.push_back(parse_row(path, line, needs_tilt));
    }
  }
  if (alignment.rows.empty()) {
    throw Error(fmt::format("'{}' has no rows of an AreTomo alignment", path.string()));
  }
  require_all_patches(path, alignment, patch_rows, stated.contains("NumPatches"));
  return alignment;
}

}  // namespace tomofield::io
