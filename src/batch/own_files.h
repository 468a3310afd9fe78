#pragma once

#include <filesystem>
#include <vector>

#include "batch/job.h"
#include "batch/planning.h"

namespace tomofield::batch {

/// Returns the files of the batch itself: its list, summary, choice, script and table for RELION,
/// the answers of sbatch, and the logs, states and trials of its jobs.
std::vector<std::filesystem::path> files_of_batch(const std::filesystem::path& folder,
                                                  const std::vector<Job>& jobs);

/// Throws Error if one of them is there, would be replaced or removed, and is not of an earlier
/// batch. A batch that goes on reads the choice, and does not replace it.
void require_own_files(const std::vector<Job>& jobs, const PlanOptions& options);

}  // namespace tomofield::batch
