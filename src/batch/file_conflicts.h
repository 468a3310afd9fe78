#pragma once

#include <filesystem>
#include <vector>

#include "batch/job.h"
#include "batch/series_list.h"

namespace tomofield::batch {

/// Adds a mistake if a file that a job or the batch itself would write is
/// written by another one too, or is read by any: the series, their angles, …, and `list`, the
/// table or STAR file of the series. Files are the same if they are so on the disk, however their
/// names are spelled. The plans of the jobs name their files; those of a job that is skipped are
/// the usual ones.
void check_files(const std::filesystem::path& folder, const std::filesystem::path& list,
                 const std::vector<Job>& jobs, base::Faults& faults);

}  // namespace tomofield::batch
