#pragma once

#include <string>

namespace tomofield::option_table {

/// Returns docs/options.md: every option with its flag, unit, range, default and JSON key.
std::string options_markdown();

}  // namespace tomofield::option_table
