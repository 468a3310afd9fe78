#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Returns the subcommand that the leading words of the arguments name.
const CLI::App* find_command(const CLI::App& program, const std::vector<std::string>& arguments);

/// Returns the words that call a command, such as "tomofield baseline tv".
std::string full_name(const CLI::App& command);

/// Returns true if the arguments give an option, as `--bin 4` or `--bin=4`.
bool is_given(const CLI::Option& option, const std::vector<std::string>& arguments);

}  // namespace tomofield::cli
