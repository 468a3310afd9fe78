#include "io/tables/star_escapes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <optional>
#include <vector>

namespace tomofield::io {
namespace {

constexpr std::string_view kEscape = "~%";
constexpr std::size_t kDigits = 2;
constexpr std::string_view kBlanks = " \t";

// A word of a line, or what stands in quotes.
struct Word {
  std::size_t begin = 0;
  std::string_view text;
  bool is_quoted = false;
};

// Returns the words of a line up to a comment.
std::vector<Word> words_of(std::string_view line) {
  std::vector<Word> words;
  for (std::size_t at = 0; (at = line.find_first_not_of(kBlanks, at)) < line.size();) {
    const char first = line[at];
    if (first == '#') break;
    const bool is_quoted = first == '"' || first == '\'';
    std::size_t end = at + 1;
    // A quote ends where a blank follows it.
    const auto is_end = [&] {
      return is_quoted ? line[end - 1] == first && end - 1 > at &&
                             kBlanks.find(line[end]) != std::string_view::npos
                       : kBlanks.find(line[end]) != std::string_view::npos;
    };
    while (end < line.size() && !is_end()) ++end;
    words.push_back({at, line.substr(at, end - at), is_quoted});
    at = end;
  }
  return words;
}

// Tells whether a word begins a part of a file: "data_TS_01", "loop_".
bool is_head(const Word& word) {
  if (word.is_quoted) return false;
  return std::ranges::any_of(
      std::array<std::string_view, 5>{"data_", "save_", "loop_", "stop_", "global_"},
      [&](std::string_view head) {
        return word.text.size() >= head.size() &&
               std::ranges::equal(word.text.substr(0, head.size()), head, {}, [](unsigned char c) {
                 return static_cast<char>(std::tolower(c));
               });
      });
}

bool is_loop(const Word& word) {
  constexpr std::string_view kLoop = "loop_";
  return is_head(word) && word.text.size() == kLoop.size() && (word.text[0] | ' ') == kLoop[0];
}

bool is_tag(const Word& word) { return !word.is_quoted && word.text.starts_with('_'); }

// Returns the places of words of a line that are values and look like something else: heads and
// tags stand first, and what follows a head is a tag or a loop.
std::vector<std::size_t> odd_values(const std::vector<Word>& words) {
  std::vector<std::size_t> places;
  if (words.empty()) return places;
  const auto is_sign = [](const Word& word) { return !word.is_quoted && word.text[0] == '$'; };
  if (is_tag(words.front())) {  // of a loop, or with its value behind it
    if (words.size() > 1 && (is_head(words[1]) || is_sign(words[1])))
      places.push_back(words[1].begin);
    return places;
  }
  if (is_head(words.front())) {
    if (words.size() == 1 || is_loop(words[1]) || is_tag(words[1])) return places;
    places.push_back(words.front().begin);
  }
  for (const Word& word : words) {
    const bool is_odd = is_head(word) || is_tag(word) || is_sign(word);
    if (is_odd && (places.empty() || places.back() != word.begin)) places.push_back(word.begin);
  }
  return places;
}

// Adds the places in quoted words where gemmi would see the end of the quotes: a quote of theirs
// before the sign of a comment.
void add_comment_signs(const std::vector<Word>& words, std::vector<std::size_t>& places) {
  for (const Word& word : words)
    for (std::size_t i = 2; word.is_quoted && i < word.text.size(); ++i)
      if (word.text[i] == '#' && word.text[i - 1] == word.text[0]) places.push_back(word.begin + i);
  std::ranges::sort(places);
}

std::string escape(unsigned char byte) { return fmt::format("{}{:02X}", kEscape, byte); }

// Returns a line with the bytes at some places escaped, and those that no word of CIF has.
std::string escaped_line(std::string_view line, const std::vector<std::size_t>& places) {
  std::string escaped;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const auto byte = static_cast<unsigned char>(line[i]);
    const bool is_escape = line.substr(i).starts_with(kEscape);
    if (byte > '~' || is_escape || std::ranges::binary_search(places, i))
      escaped += escape(byte);
    else
      escaped += line[i];
  }
  return escaped;
}

std::optional<char> byte_of(std::string_view digits) {
  unsigned value = 0;
  const auto [end, fault] =
      std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  const bool is_whole = fault == std::errc() && end == digits.data() + digits.size();
  return is_whole && digits.size() == kDigits ? std::optional(static_cast<char>(value))
                                              : std::nullopt;
}

}  // namespace

std::string escaped_star(std::string_view text) {
  std::string escaped;
  bool is_in_text = false;  // of several lines, between lines that begin with a semicolon
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    const bool turns = line.starts_with(';');
    std::vector<std::size_t> places;
    if (!is_in_text && !turns) {
      const std::vector<Word> words = words_of(line);
      places = odd_values(words);
      add_comment_signs(words, places);
    }
    escaped += escaped_line(line, places);
    if (turns) is_in_text = !is_in_text;
    if (end < text.size()) escaped += '\n';
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return escaped;
}

std::string unescaped_star(std::string_view word) {
  std::string plain;
  for (std::size_t i = 0; i < word.size(); ++i) {
    const auto byte = word.substr(i).starts_with(kEscape)
                          ? byte_of(word.substr(i + kEscape.size(), kDigits))
                          : std::nullopt;
    plain += byte.value_or(word[i]);
    if (byte) i += kEscape.size() + kDigits - 1;
  }
  return plain;
}

}  // namespace tomofield::io
