#pragma once

#include <string>

namespace tomofield::option_table {

/// Returns docs/options.md: every option with its flag, unit, range, default and JSON key.
std::string options_markdown();

/// Returns python/tomofield/options.py: the names and the types of all options in Python.
std::string options_python();

}  // namespace tomofield::option_table
