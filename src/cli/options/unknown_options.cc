#include "cli/options/unknown_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <numeric>

namespace tomofield::cli {
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

// Returns the long names of the options that are most like an unknown one, if any is like it.
std::vector<std::string> nearest_options(const CLI::App& command, const std::string& unknown) {
  constexpr std::size_t kDashes = 2;
  std::vector<std::string> nearest;
  std::size_t least = std::max<std::size_t>((unknown.size() - kDashes) / 3, 1);
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      const std::size_t d = distance(unknown, "--" + name);
      if (d > least) continue;
      if (d < least) nearest.clear();
      least = d;
      nearest.push_back("--" + name);
    }
  }
  return nearest;
}

// Says whether a word is written like an option, and not like a negative number.
bool is_option(const std::string& word) {
  return word.size() > 1 && word[0] == '-' && word[1] != '.' &&
         std::isdigit(static_cast<unsigned char>(word[1])) == 0;
}

std::string fault_of_option(const CLI::App& command, const std::string& word) {
  const std::string name = word.substr(0, word.find('='));
  const std::vector<std::string> nearest = nearest_options(command, name);
  const std::string sentence = fmt::format("there is no option {}", name);
  if (nearest.empty()) return sentence;
  return fmt::format("{} (did you mean {}?)", sentence, fmt::join(nearest, " or "));
}

}  // namespace

std::string fault_of_unknown_words(const CLI::App& command,
                                   const std::vector<std::string>& arguments) {
  const std::vector<std::string> unknown = command.remaining();
  std::vector<std::string> options, words;
  for (const std::string& word : arguments) {
    if (std::ranges::find(unknown, word) == unknown.end()) continue;
    if (is_option(word))
      options.push_back(fault_of_option(command, word));
    else
      words.push_back(fmt::format("'{}'", word));
  }
  if (!options.empty()) return fmt::format("{}", fmt::join(options, "; "));
  if (words.empty()) return {};
  return fmt::format("{} {} to no option", fmt::join(words, ", "),
                     words.size() == 1 ? "belongs" : "belong");
}

}  // namespace tomofield::cli
