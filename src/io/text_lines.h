#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tomofield::io {

/// One line of a text file, without white space at its ends; `number` counts from 1.
struct TextLine {
  int number = 0;
  std::string text;
};

/// Returns the lines of a small text file without the empty ones. Either kind of line end is
/// accepted. Throws Error if the file cannot be read or is no text (larger than any alignment file,
/// or with zero bytes).
std::vector<TextLine> read_text_lines(const std::filesystem::path& path);

std::string_view trim(std::string_view text);
std::vector<std::string_view> split_words(std::string_view text);

/// Parses a whole word as a number. Returns nothing if any character is left over. "nan" and "inf"
/// are numbers here.
std::optional<double> parse_number(std::string_view word);
std::optional<long long> parse_integer(std::string_view word);

}  // namespace tomofield::io
