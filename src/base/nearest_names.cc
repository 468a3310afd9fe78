#include "base/nearest_names.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace tomofield::base {
namespace {

// Returns how many letters must be changed, put in or left out to turn one word into another.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row[b.size()];
}

// Returns the names that are the fewest letters away, at most a third of the unknown one's.
std::vector<std::string> nearest_by_letters(const std::string& unknown,
                                            const std::vector<std::string>& names) {
  std::vector<std::string> nearest;
  std::size_t least = std::max<std::size_t>(unknown.size() / 3, 1);
  for (const std::string& name : names) {
    const std::size_t d = distance(unknown, name);
    if (d > least) continue;
    if (d < least) nearest.clear();
    least = d;
    nearest.push_back(name);
  }
  return nearest;
}

// Returns the words of a name that dashes or underscores separate.
std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    if (c == '-' || c == '_')
      words.emplace_back();
    else
      words.back() += c;
  }
  std::erase(words, "");
  return words;
}

// Says whether each word of one name begins a word of another. A single letter begins too many.
bool has_words_of(const std::vector<std::string>& whole, const std::vector<std::string>& part) {
  return !part.empty() && std::ranges::all_of(part, [&](const std::string& word) {
    return word.size() > 1 && std::ranges::any_of(whole, [&](const std::string& other) {
             return other.starts_with(word);
           });
  });
}

std::vector<std::string> nearest_by_words(const std::string& unknown,
                                          const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 3;
  const std::vector<std::string> words = words_of(unknown);
  std::vector<std::string> alike;
  for (const std::string& name : names) {
    const std::vector<std::string> others = words_of(name);
    if (has_words_of(others, words) || has_words_of(words, others)) alike.push_back(name);
  }
  if (alike.size() > kMost) return {};
  std::ranges::stable_sort(alike, {}, &std::string::size);
  return alike;
}

}  // namespace

std::vector<std::string> nearest_names(const std::string& unknown,
                                       const std::vector<std::string>& names) {
  const std::vector<std::string> nearest = nearest_by_letters(unknown, names);
  return nearest.empty() ? nearest_by_words(unknown, names) : nearest;
}

std::string did_you_mean(const std::vector<std::string>& nearest) {
  return nearest.empty() ? "" : fmt::format(" (did you mean {}?)", fmt::join(nearest, " or "));
}

}  // namespace tomofield::base
