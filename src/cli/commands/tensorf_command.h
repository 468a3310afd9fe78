#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// Registers `baseline tensorf`.
void add_tensorf(CLI::App& baseline);

}  // namespace tomofield::cli
