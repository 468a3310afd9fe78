#include "cli/options/parse_fault.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <system_error>

#include "base/nearest_names.h"
#include "cli/options/project_options.h"

namespace tomofield::cli {
namespace {

// Returns the long names of the options that are most like an unknown one, if any is like it.
std::vector<std::string> nearest_options(const CLI::App& command, const std::string& unknown) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  std::vector<std::string> nearest = base::nearest_names(
      unknown.substr(std::min(unknown.find_first_not_of('-'), unknown.size())), names);
  for (std::string& name : nearest) name.insert(0, "--");
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
  return fmt::format("there is no option {}{}", name, base::did_you_mean(nearest));
}

// Returns a sentence on files beyond the one list that a command takes: those of a pattern that the
// shell has filled in. Returns an empty text if the words are something else.
std::string fault_of_pattern(const CLI::App& command, const std::vector<std::string>& words) {
  const auto exists = [](const std::string& word) {
    std::error_code fault;
    return std::filesystem::exists(word, fault);
  };
  if (command.get_option_no_throw("LIST") == nullptr || !std::ranges::all_of(words, exists))
    return {};
  return fmt::format(
      "'{}'{} beside the list: put a pattern in quotes, as in 'data/*.mrc', so that the shell does "
      "not fill it in",
      words.front(),
      words.size() == 1 ? " is" : fmt::format(" and {} more files are", words.size() - 1));
}

// Returns a sentence on the words that the command does not know, in their order, or an empty text.
std::string fault_of_unknown_words(const CLI::App& command,
                                   const std::vector<std::string>& arguments) {
  const std::vector<std::string> unknown = command.remaining();
  std::vector<std::string> options, words;
  for (const std::string& word : arguments) {
    if (std::ranges::find(unknown, word) == unknown.end()) continue;
    if (is_option(word))
      options.push_back(fault_of_option(command, word));
    else
      words.push_back(word);
  }
  if (!options.empty()) return fmt::format("{}", fmt::join(options, "; "));
  if (words.empty()) return {};
  if (std::string fault = fault_of_pattern(command, words); !fault.empty()) return fault;
  return fmt::format("'{}' {} to no option", fmt::join(words, "', '"),
                     words.size() == 1 ? "belongs" : "belong");
}

// Returns a sentence if the stack of a command is not there, or an empty text.
std::string fault_of_given_stack(const CLI::App& command) {
  const CLI::Option* stack = command.get_option_no_throw("stack");
  return stack == nullptr || stack->count() == 0 ? "" : fault_of_stack(stack->results().front());
}

// Returns the spellings of an option among the arguments, in their order.
std::vector<std::string> spellings(const CLI::Option& option,
                                   const std::vector<std::string>& arguments) {
  std::vector<std::string> found;
  for (const std::string& word : arguments) {
    const std::string name = word.substr(0, word.find('='));
    if (is_option(name) && option.check_name(name)) found.push_back(name);
  }
  return found;
}

// Returns a sentence on the first option that is given twice and takes one value, or an empty text.
std::string fault_of_repetition(const CLI::App& command,
                                const std::vector<std::string>& arguments) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_multi_option_policy() != CLI::MultiOptionPolicy::Throw) continue;
    const std::vector<std::string> names = spellings(*option, arguments);
    if (names.size() < 2) continue;
    if (names[0] != names[1])
      return fmt::format("{} and {} are one option: give one of them", names[0], names[1]);
    return fmt::format("{} is given {}: give it once", names[0],
                       names.size() == 2 ? "twice" : fmt::format("{} times", names.size()));
  }
  return {};
}

// Returns a text of CLI11, which calls each option by one of its names, with the names that the
// arguments have.
std::string as_spelt(const CLI::App& command, const std::vector<std::string>& arguments,
                     std::string text) {
  const auto goes_on = [&](std::size_t at) {
    return at < text.size() &&
           (text[at] == '-' || std::isalnum(static_cast<unsigned char>(text[at])));
  };
  for (const CLI::Option* option : command.get_options()) {
    const std::vector<std::string> names = spellings(*option, arguments);
    const std::string name = option->get_name();
    const std::size_t at = names.empty() || names[0] == name ? text.npos : text.find(name);
    if (at == text.npos || goes_on(at + name.size())) continue;
    text.replace(at, name.size(), names[0]);
  }
  return text;
}

}  // namespace

std::string parse_fault(const CLI::App& command, const std::vector<std::string>& arguments,
                        const CLI::ParseError& error) {
  if (std::string fault = fault_of_unknown_words(command, arguments); !fault.empty()) return fault;
  if (std::string fault = fault_of_given_stack(command); !fault.empty()) return fault;
  const bool is_count = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ArgumentMismatch);
  std::string repetition = is_count ? fault_of_repetition(command, arguments) : "";
  return repetition.empty() ? as_spelt(command, arguments, error.what()) : repetition;
}

}  // namespace tomofield::cli
