#include "cli/options/command_line.h"

#include <algorithm>

namespace tomofield::cli {

const CLI::App* find_command(const CLI::App& program, const std::vector<std::string>& arguments) {
  const CLI::App* command = &program;
  for (const std::string& word : arguments) {
    const auto named =
        command->get_subcommands([&](const CLI::App* sub) { return sub->get_name() == word; });
    if (named.empty()) break;
    command = named.front();
  }
  return command;
}

std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? "tomofield" : full_name(*parent) + " " + command.get_name();
}

bool is_given(const CLI::Option& option, const std::vector<std::string>& arguments) {
  return std::any_of(arguments.begin(), arguments.end(), [&](const std::string& argument) {
    const std::string name = argument.substr(0, argument.find('='));
    return name.rfind('-', 0) == 0 && option.check_name(name);
  });
}

}  // namespace tomofield::cli
