#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "option_table/given_option.h"

namespace tomofield::cli {

/// Returns the options of a command that were given, but for those with the names in `except`. A
/// positional argument has no flag. Several values of one option are joined by commas.
std::vector<option_table::GivenOption> given_options(const CLI::App& command,
                                                     const std::vector<std::string>& except);

}  // namespace tomofield::cli
