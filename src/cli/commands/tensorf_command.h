#pragma once

#include <CLI/CLI.hpp>
#include <vector>

#include "option_table/setting.h"

namespace tomofield::cli {

/// Registers `baseline tensorf`.
void add_tensorf(CLI::App& baseline, const std::vector<Setting>& origins);

}  // namespace tomofield::cli
