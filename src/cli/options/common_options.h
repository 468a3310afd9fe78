#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// Registers the options of every command that computes: --threads, which takes effect as soon as
/// it is parsed, and --config. The latter is registered for the help alone: expand_config_file()
/// has removed it from the arguments by then.
void add_common_options(CLI::App& command);

}  // namespace tomofield::cli
