#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tomofield::io {

/// Checks before any work that results can be written. Throws Error if two results would be one
/// file, if one would replace one of the `inputs` (even if it may replace results), if one cannot
/// be written at its place, or, unless `may_replace`, if one exists. In the last case, `advice`
/// tells the user what to do instead.
void check_output_files(const std::vector<std::filesystem::path>& results,
                        const std::vector<std::filesystem::path>& inputs, bool may_replace,
                        const std::string& advice);

}  // namespace tomofield::io
