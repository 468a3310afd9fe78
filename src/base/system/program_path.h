#pragma once

#include <filesystem>

namespace tomofield::base {

/// Returns the path by which this program can be started again. The portable archive starts it
/// through a script, which says its own path in the variable TOMOFIELD_LAUNCHER (tools/portable).
std::filesystem::path program_path();

}  // namespace tomofield::base
