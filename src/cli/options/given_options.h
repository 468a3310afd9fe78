#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "option_table/given_option.h"
#include "option_table/rows.h"
#include "tomofield/options.h"

namespace tomofield::cli {

/// Returns the options of a command that were given, but for those with the names in `except`. A
/// positional argument has no flag. Several values of one option are joined by commas.
std::vector<option_table::GivenOption> given_options(const CLI::App& command,
                                                     const std::vector<std::string>& except);

/// Notes the settings that files made (Options::settings), and which options the user gave
/// (Options::given): those of a parsed command that no setting made.
void note_origins(const CLI::App& command, const std::vector<Setting>& settings,
                  option_table::Choices& choices);

}  // namespace tomofield::cli
