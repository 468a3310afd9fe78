#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::output {

/// Returns every file that a series is read from.
std::vector<std::filesystem::path> input_files(const SeriesFiles& files);

/// Checks that the results of a series can be written (io/output_files.h) and that none replaces a
/// file that the series is read from. Pictures of slices (report/slice.h) are results too. Throws
/// Error, with `advice`, otherwise.
void check_result_files(std::vector<std::filesystem::path> results,
                        const std::filesystem::path& picture_prefix, const SeriesFiles& input,
                        bool may_replace, const std::string& advice);

}  // namespace tomofield::output
