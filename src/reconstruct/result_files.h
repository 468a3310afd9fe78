#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruct {

/// What stands in the way of writing results, found out before any work. Throws
/// Error if two results would be one file, one would replace a file that the
/// series is read from (even with --overwrite), the first cannot be written
/// where it shall go, or, unless `may_replace`, one exists; `advice` then says
/// what can be done instead. Pictures of slices (report/slices.h) are results too.
void check_result_files(std::vector<std::filesystem::path> results,
                        const std::filesystem::path& picture_prefix,
                        const tilt_series::TiltSeriesOptions& input, bool may_replace,
                        const std::string& advice);

}  // namespace tomofield::reconstruct
