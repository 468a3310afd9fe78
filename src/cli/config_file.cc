#include "cli/config_file.h"

#include <fmt/format.h>

#include <toml++/toml.h>
#include <algorithm>
#include <sstream>

#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

// Removes `--config FILE` or `--config=FILE`; returns FILE or nothing.
std::string take_config_path(std::vector<std::string>& arguments) {
  const std::string flag = "--config";
  for (auto it = arguments.begin(); it != arguments.end(); ++it) {
    if (*it == flag) {
      if (it + 1 == arguments.end()) throw Error("--config needs a file name");
      const std::string path = *(it + 1);
      arguments.erase(it, it + 2);
      return path;
    }
    if (it->rfind(flag + "=", 0) == 0) {
      const std::string path = it->substr(flag.size() + 1);
      arguments.erase(it);
      return path;
    }
  }
  return {};
}

toml::table read_toml(const std::string& path) {
  try {
    return toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    throw Error(fmt::format("{}, line {}: {}", path, error.source().begin.line,
                            std::string(error.description())));
  }
}

std::string value_text(const std::string& path, const std::string& key, const toml::node& node) {
  if (const auto text = node.value_exact<std::string>()) return *text;
  if (const auto integer = node.value_exact<std::int64_t>()) return fmt::format("{}", *integer);
  if (const auto number = node.value_exact<double>()) return fmt::format("{}", *number);
  throw Error(
      fmt::format("{}, line {}: '{}' must be a number, a text, true or false, or an array of these",
                  path, node.source().begin.line, key));
}

bool is_given(const CLI::Option& option, const std::vector<std::string>& arguments) {
  return std::any_of(arguments.begin(), arguments.end(), [&](const std::string& argument) {
    const std::string name = argument.substr(0, argument.find('='));
    return name.rfind('-', 0) == 0 && option.check_name(name);
  });
}

// The subcommand that the leading words of the arguments name.
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

}  // namespace

void expand_config_file(const CLI::App& program, std::vector<std::string>& arguments) {
  const std::string path = take_config_path(arguments);
  if (path.empty()) return;
  const CLI::App* command = find_command(program, arguments);
  for (const auto& [key, node] : read_toml(path)) {
    const std::string name(key.str());
    const CLI::Option* option = command->get_option_no_throw("--" + name);
    if (option == nullptr) {
      throw Error(fmt::format(
          "{}, line {}: '{}' is no option of '{}'; `tomofield {} --help` lists them", path,
          node.source().begin.line, name, command->get_name(), command->get_name()));
    }
    if (is_given(*option, arguments)) continue;
    if (const auto flag = node.value_exact<bool>()) {
      if (*flag) arguments.push_back("--" + name);
      continue;
    }
    arguments.push_back("--" + name);
    if (const toml::array* array = node.as_array()) {
      for (const toml::node& element : *array) arguments.push_back(value_text(path, name, element));
    } else {
      arguments.push_back(value_text(path, name, node));
    }
  }
}

}  // namespace tomofield::cli
