#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tomofield::cli {

/// Replaces `--config FILE` in the arguments of a subcommand by the options that the TOML file
/// sets. `thickness = 150` stands for `--thickness 150`, `overwrite = true` for `--overwrite`, and
/// an array for several values. Options on the command line win. Throws Error for a file that
/// cannot be read and for keys that the subcommand does not know.
void expand_config_file(const CLI::App& program, std::vector<std::string>& arguments);

/// Returns the names of the options that a file of --config sets. Throws Error for a file that
/// cannot be read.
std::vector<std::string> names_in_config_file(const std::string& path);

}  // namespace tomofield::cli
