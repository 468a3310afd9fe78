#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// Registers what every command that computes has: --threads, which takes effect
/// as soon as it is parsed, and --config, so that the help lists it
/// (expand_config_file() has taken it from the arguments by then).
void add_common_options(CLI::App& command);

}  // namespace tomofield::cli
