#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// Puts an example of each command into its help, unless the command has a text of its own there.
/// CLI11 gives commands that of the program.
void add_examples(CLI::App& program);

}  // namespace tomofield::cli
