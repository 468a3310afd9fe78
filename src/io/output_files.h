#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tomofield::io {

/// What stands in the way of writing results, found out before any work. Throws
/// Error if two results would be one file, one would replace one of the `inputs`
/// (even if it may replace results), one cannot be written where it shall go, or, unless
/// `may_replace`, one exists; `advice` then says what can be done instead.
void check_output_files(const std::vector<std::filesystem::path>& results,
                        const std::vector<std::filesystem::path>& inputs, bool may_replace,
                        const std::string& advice);

}  // namespace tomofield::io
