#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "option_table/setting.h"

namespace tomofield::cli {

/// Registers --series, which chooses one series of a project.
void add_project_options(CLI::App& command);

/// Replaces a project that is given where a command expects a stack (projects/project.h) by the
/// stack and by the options that its files set. Options among the arguments win. Prints each
/// setting with the file that it comes from, and returns them: those that do not hold say what
/// holds in their place. Arguments without a project stay as they are. Call it after
/// expand_config_file(). Throws Error for a project that cannot be honoured.
std::vector<Setting> expand_project(const CLI::App& program, std::vector<std::string>& arguments);

}  // namespace tomofield::cli
