#include "cli/options/project_arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "io/saving/output_files.h"
#include "option_table/values.h"
#include "projects/project.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

using Words = std::vector<std::string>;

constexpr const char* kStack = "stack";
constexpr const char* kIgnore = "--ignore";
constexpr const char* kSeries = "--series";

const CLI::Option* option_named(const CLI::App& command, const std::string& word) {
  const auto options =
      command.get_options([&](const CLI::Option* o) { return o->check_name(word); });
  return options.empty() ? nullptr : options.front();
}

// Returns the number of words that name a command.
std::ptrdiff_t num_words(const CLI::App& command) {
  return command.get_parent() == nullptr ? 0 : 1 + num_words(*command.get_parent());
}

// Returns the word of the arguments that is the stack, or their end.
Words::iterator find_stack(const CLI::App& command, Words& arguments) {
  for (auto word = arguments.begin() + num_words(command); word != arguments.end(); ++word) {
    if (!word->starts_with('-')) return word;
    const CLI::Option* option = option_named(command, *word);
    const bool takes_next = option != nullptr && option->get_items_expected_max() > 0;
    if (takes_next && std::next(word) != arguments.end()) ++word;
  }
  return arguments.end();
}

// Returns the value of an option among the arguments, or an empty text.
std::string value_of(std::string_view flag, const Words& arguments) {
  for (auto word = arguments.begin(); word != arguments.end(); ++word) {
    if (*word == flag && std::next(word) != arguments.end()) return *std::next(word);
    if (word->starts_with(flag) && word->substr(flag.size()).starts_with('='))
      return word->substr(flag.size() + 1);
  }
  return {};
}

// Returns the word that sets an option.
std::string word_of(const CLI::Option& option, const Setting& setting) {
  const bool is_flag = option.get_items_expected_max() == 0;
  return is_flag ? setting.option : fmt::format("{}={}", setting.option, setting.value);
}

// Returns the option among the user's arguments that stands in place of a setting, or an empty
// text.
std::string winner_over(const Setting& setting, const CLI::App& command, const Words& given) {
  // A user gives one option of each pair.
  constexpr std::pair<std::string_view, std::string_view> kRivals[] = {{"--bin", "--angpix"},
                                                                       {"--angpix", "--bin"},
                                                                       {"--xf", "--aln"},
                                                                       {"--aln", "--xf"},
                                                                       {"--ctf", "--defocus"}};
  if (is_given(*command.get_option(setting.option), given)) return setting.option;
  const bool is_of_intensities = setting.option == "--log" || setting.option == "--log-base";
  if (is_of_intensities && value_of("--contrast", given) == "bright") return "--contrast bright";
  constexpr std::array<std::string_view, 6> kOfTransfer{
      "--ctf", "--mtf", "--cs", "--amplitude-contrast", "--ctf-phase-flipped", "--defocus-hand"};
  const bool is_transfer = std::ranges::find(kOfTransfer, setting.option) != kOfTransfer.end();
  if (is_transfer && value_of("--engine", given) == "ray") return "--engine ray";
  for (const auto& [option, rival] : kRivals) {
    if (option == setting.option && is_given(*command.get_option(std::string(rival)), given))
      return std::string(rival);
  }
  return {};
}

void print_setting(const Setting& setting, std::string_view remark) {
  print("{} {} from {}: {}{}\n", setting.option, setting.value, setting.file.string(),
        setting.entry, remark);
}

}  // namespace

void add_project_options(CLI::App& command) {
  command
      .add_option_function<std::string>(
          kSeries, [](const std::string&) {},
          "One tilt series of a project that has several, by its name")
      ->type_name("NAME")
      ->group(kProjectGroup);
}

std::vector<Setting> expand_project(const CLI::App& program, Words& arguments) {
  const CLI::App& command = *find_command(program, arguments);
  if (command.get_option_no_throw(kStack) == nullptr) return {};
  const auto stack = find_stack(command, arguments);
  if (stack == arguments.end()) return {};
  const auto project =
      projects::read_project({.path = *stack,
                              .ignored = option_table::split_names(value_of(kIgnore, arguments)),
                              .series = value_of(kSeries, arguments),
                              .has_mdoc = !value_of("--mdoc", arguments).empty(),
                              .has_transfer = !value_of("--defocus", arguments).empty() ||
                                              !value_of("--ctf", arguments).empty()});
  if (!project) return {};
  for (const auto& file : project->files()) io::add_input(file);
  const Words given = arguments;
  std::vector<Setting> used;
  for (const Setting& setting : project->settings()) {
    const CLI::Option* option = command.get_option_no_throw(setting.option);
    if (option == nullptr) {
      print_setting(setting, " (not an option of this command)");
    } else if (option->get_positional()) {
      *find_stack(command, arguments) = setting.value;
      print_setting(setting, "");
      used.push_back(setting);
    } else if (const std::string winner = winner_over(setting, command, given); !winner.empty()) {
      print_setting(setting, fmt::format(" (not used: {} is given)", winner));
    } else {
      arguments.push_back(word_of(*option, setting));
      print_setting(setting, "");
      used.push_back(setting);
    }
  }
  flush_output();  // settings come before other output, in a file too
  for (const std::string& warning : project->warnings()) base::log_warning(warning);
  return used;
}

}  // namespace tomofield::cli
