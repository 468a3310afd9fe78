#include <fmt/format.h>

#include <array>
#include <string>

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

// Parses "# name = numbers" and skips comments of any other form.
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
    if (numbers.size() > 2) alignment->dark_tilt_deg.push_back(numbers[2]);
  } else if (name == "AlphaOffset") {
    require(1);
    alignment->alpha_offset_deg = numbers[0];
  } else if (name == "BetaOffset") {
    require(1);
    alignment->beta_offset_deg = numbers[0];
  } else if (name == "Thickness") {
    require(1);
    if (numbers[0] > 0) alignment->thickness = numbers[0];
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

}  // namespace tomofield::io
