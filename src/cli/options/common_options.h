#pragma once

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "option_table/rows.h"
#include "option_table/setting.h"
#include "tomofield/options.h"

namespace tomofield::cli {

/// Registers the options of every command that computes: --threads, which takes effect as soon as
/// it is parsed, and --config. The latter is registered for the help alone: expand_config_file()
/// has removed it from the arguments by then.
void add_common_options(CLI::App& command);

/// Adds an option whose value is one of an enum's names (base/enum_names.h). `target` is the enum
/// or a std::optional of it.
template <typename Enum, typename Target>
CLI::Option* add_enum_option(CLI::App& command, const std::string& flag, Target& target,
                             const std::string& help) {
  std::vector<std::string> names;
  for (const auto& [value, name] : base::EnumNames<Enum>::kNames) names.emplace_back(name);
  const auto check = [names](const std::string& text) {
    return std::ranges::count(names, text) > 0
               ? std::string()
               : fmt::format("must be {}, not '{}'", fmt::join(names, " or "), text);
  };
  return command
      .add_option_function<std::string>(
          flag, [&target](const std::string& name) { target = *base::enum_named<Enum>(name); },
          help)
      ->check(CLI::Validator(check, ""))
      ->type_name(fmt::format("{}", fmt::join(names, "|")));
}

/// Returns the options of a command that were given, but for those with the names in `except`. A
/// positional argument has no flag. Several values of one option are joined by commas.
std::vector<option_table::GivenOption> given_options(const CLI::App& command,
                                                     const std::vector<std::string>& except);

/// A file that an option asks for beside the results of a run, such as --trace.
struct ExtraFile {
  const std::optional<std::filesystem::path>& file;
  const char* flag;
};
/// Throws Error if such a file is an input or a result, cannot be written, or exists and may not be
/// replaced.
void check_extra_files(std::initializer_list<ExtraFile> files,
                       const std::vector<std::filesystem::path>& results, const SeriesFiles& input,
                       const RunOptions& run);

/// Returns the subcommand that the leading words of the arguments name.
const CLI::App* find_command(const CLI::App& program, const std::vector<std::string>& arguments);

/// Returns the words that call a command, such as "tomofield baseline tv".
std::string full_name(const CLI::App& command);

/// Returns true if the arguments give an option, as `--bin 4` or `--bin=4`.
bool is_given(const CLI::Option& option, const std::vector<std::string>& arguments);

}  // namespace tomofield::cli
