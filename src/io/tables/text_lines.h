#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/plausible.h"

namespace tomofield::io {

/// Returns the bytes of a small file. Throws Error if it cannot be read, is no regular file (a pipe
/// would never end), or is larger than the text files of any series.
std::string read_small_file(const std::filesystem::path& path);

/// Does the same for a text file, without a byte order mark, and refuses one with zero bytes.
std::string read_text_file(const std::filesystem::path& path);

/// One line of a text file, without white space at its ends; `number` counts from 1.
struct TextLine {
  int number = 0;
  std::string text;
};

/// Returns the lines of a small text file without the empty ones. Either kind of line end is
/// accepted. Throws Error if the file cannot be read or is no text: if it has zero bytes, or more
/// bytes or lines than an alignment of any series.
std::vector<TextLine> read_text_lines(const std::filesystem::path& path);

std::string_view trim(std::string_view text);
std::vector<std::string_view> split_words(std::string_view text);

/// The largest exposure of a specimen in electrons per Å²: 100 times what a tilt series has.
inline constexpr double kLargestDose = 1e4;

/// Parses a whole word as a number within an interval. Returns nothing if the word is another
/// number or none, or if any character is left over. All readers of text files get their numbers
/// from here.
std::optional<base::Finite> parse_number(std::string_view word,
                                         base::Interval within = base::kLargestNumber);
/// Parses a whole word as an integer from −1e9 to 1e9.
std::optional<std::int64_t> parse_integer(std::string_view word);

/// Returns text from a file as a message quotes it: at most 60 bytes, and no half characters.
std::string quote(std::string_view text);

}  // namespace tomofield::io
