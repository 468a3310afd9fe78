#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "option_table/rows.h"

namespace tomofield::cli {

/// Returns a sentence if a stack is not there, or an empty text. A half of a table of views,
/// "even@TS_01.star", is no file.
std::string fault_of_stack(const std::filesystem::path& stack);

/// Registers --series, which chooses one series of a project.
void add_project_options(CLI::App& command);

/// Notes which options of a parsed command the user gave (Options::given). Replaces a project that
/// was given as the stack (projects/project.h) by its stack and by the options that its files set,
/// and prints each of them with the file that it comes from. Options that the user gave win. A
/// stack stays as it is. Throws Error for a project that cannot be honoured.
void open_project(const CLI::App& command, option_table::Choices& choices);

}  // namespace tomofield::cli
