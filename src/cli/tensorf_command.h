#pragma once

#include <CLI/CLI.hpp>

namespace tomofield::cli {

/// `baseline tensorf`.
void add_tensorf(CLI::App& baseline);

}  // namespace tomofield::cli
