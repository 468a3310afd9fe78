#include "io/tables/text_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>

#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // of UTF-8, as Windows writes it
constexpr std::string_view kWhiteSpace = " \t\r\n\v\f";
// A fiducial model with 1,000 points in each of 200 sections has 8 MiB and 200,000 lines.
constexpr std::int64_t kLargestTextFile = std::int64_t{16} << 20;
constexpr int kMostLines = 1 << 20;

[[noreturn]] void throw_no_text(const std::filesystem::path& path, std::int64_t bytes) {
  throw Error(fmt::format(
      "'{}' is no text file that is read here ({} bytes): give one of at most {} MiB, without zero "
      "bytes",
      path.string(), bytes, kLargestTextFile >> 20));
}

template <typename T>
std::optional<T> parse_whole(std::string_view word) {
  // from_chars does not accept a plus sign.
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

}  // namespace

std::string read_small_file(const std::filesystem::path& path) {
  const PositionedFile file(path, PositionedFile::Access::kRead);
  const std::int64_t bytes = file.size();
  if (bytes > kLargestTextFile) throw_no_text(path, bytes);
  std::string text(static_cast<std::size_t>(bytes), '\0');
  file.read_at(0, text.data(), text.size());
  return text;
}

std::string read_text_file(const std::filesystem::path& path) {
  std::string text = read_small_file(path);
  if (text.find('\0') != std::string::npos) throw_no_text(path, std::ssize(text));
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  return text;
}

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kWhiteSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kWhiteSpace) - first + 1);
}

std::vector<std::string_view> split_words(std::string_view text) {
  std::vector<std::string_view> words;
  std::size_t at = text.find_first_not_of(kWhiteSpace);
  while (at != std::string_view::npos) {
    const std::size_t end = text.find_first_of(kWhiteSpace, at);
    words.push_back(text.substr(at, end - at));
    at = text.find_first_not_of(kWhiteSpace, end);
  }
  return words;
}

std::vector<TextLine> read_text_lines(const std::filesystem::path& path) {
  const std::string text = read_text_file(path);
  std::vector<TextLine> lines;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view line = trim(std::string_view(text).substr(at, end - at));
    if (++number > kMostLines) {
      throw Error(fmt::format("'{}' has more than {} lines, so it is no file of a tilt series",
                              path.string(), kMostLines));
    }
    if (!line.empty()) lines.push_back({number, std::string(line)});
    at = end + 1;
  }
  return lines;
}

std::optional<base::Finite> parse_number(std::string_view word, base::Interval within) {
  const auto value = parse_whole<double>(word);
  return value ? within.find(*value) : std::nullopt;
}

std::optional<std::int64_t> parse_integer(std::string_view word) {
  const auto value = parse_whole<std::int64_t>(word);
  return value && base::is_plausible(static_cast<double>(*value)) ? value : std::nullopt;
}

std::string quote(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  if (text.size() <= kLongest) return std::string(text);
  std::size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "…";
}

}  // namespace tomofield::io
