#include "batch/placeholders.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "batch/series_list.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

bool is_letter(unsigned char c) { return std::isalpha(c) != 0 || c == '_'; }

// Returns what a word in braces stands for. Throws Error for a word that stands for nothing.
std::string meaning_of(const std::string& word, const fs::path& input, const std::string& where) {
  if (word == "name") return series_name(input);
  if (word == "folder") return input.has_parent_path() ? input.parent_path().string() : ".";
  throw Error(
      fmt::format("{}: '{{{}}}' stands for nothing: {{name}} stands for the name of a "
                  "series' file without its ending, {{folder}} for its folder",
                  where, word));
}

}  // namespace

std::string fill_placeholders(const fs::path& input, const std::string& text,
                              const std::string& where) {
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const auto begin = text.begin() + static_cast<std::ptrdiff_t>(at);
    const std::string word =
        *begin == '{' ? std::string(begin + 1, std::find_if_not(begin + 1, text.end(), is_letter))
                      : std::string();
    const std::size_t end = at + 1 + word.size();
    const bool is_closed = end < text.size() && text[end] == '}';
    if (!is_closed && (word == "name" || word == "folder"))
      throw Error(
          fmt::format("{}: the brace of '{{{}' is not closed: write '{{{}}}'", where, word, word));
    if (word.empty() || !is_closed) {
      result += text[at++];
      continue;
    }
    result += meaning_of(word, input, where);
    at = end + 1;
  }
  return result;
}

}  // namespace tomofield::batch
