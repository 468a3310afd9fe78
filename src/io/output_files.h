#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::io {

/// Checks before any work that results can be written. Throws Error if two results would be one
/// file, if one would replace one of the `inputs` (even if it may replace results), if one cannot
/// be written at its place, or, unless `may_replace`, if one exists. In the last case, `advice`
/// tells the user what to do instead.
void check_output_files(const std::vector<std::filesystem::path>& results,
                        const std::vector<std::filesystem::path>& inputs, bool may_replace,
                        const std::string& advice);

/// Returns every file that a series is read from.
std::vector<std::filesystem::path> input_files(const SeriesFiles& files);

/// Checks that the results of a series can be written (check_output_files()) and that none replaces
/// a file that the series is read from. Pictures of slices (report/slice.h) are results too. Throws
/// Error, with `advice`, otherwise.
void check_result_files(std::vector<std::filesystem::path> results,
                        const std::filesystem::path& picture_prefix, const SeriesFiles& input,
                        bool may_replace, const std::string& advice);

}  // namespace tomofield::io
