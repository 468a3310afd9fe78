#pragma once

#include <CLI/CLI.hpp>
#include <initializer_list>

#include "option_table/rows.h"
#include "option_table/values.h"

namespace tomofield::cli {

/// Registers one option of the table. Parsing stores its value in `choices`, which must outlive the
/// parsing and hold the default. A flag that several rows share is registered for its first row.
CLI::Option* add_row(CLI::App& command, const option_table::Row& row,
                     option_table::Choices& choices);

/// Registers the option with a key. The help shows it under its group or under the title `group`.
CLI::Option* add_row(CLI::App& command, std::string_view key, option_table::Choices& choices,
                     std::string_view group = {});

/// Registers all options of these groups.
void add_groups(CLI::App& command, option_table::Choices& choices,
                std::initializer_list<option_table::Group> groups);

/// Registers the options that say how a tilt series is read, but not its stack.
void add_series_options(CLI::App& command, option_table::Choices& choices);

/// Registers the stack as a positional argument, and the options of add_series_options().
void add_input_options(CLI::App& command, option_table::Choices& choices);

/// Registers the options that say where a volume lies in the views.
void add_place_options(CLI::App& command, option_table::Choices& choices);

/// Returns the row that an option of a command was registered for, or null.
const option_table::Row* row_of_option(const CLI::Option& option);

}  // namespace tomofield::cli
