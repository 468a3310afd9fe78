#pragma once

#include <filesystem>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// Writes what is known of all jobs into the folder of the batch: summary.csv for programs, and
/// index.html for people, with pictures, verdicts and links to the results. A batch of RELION's
/// tomograms.star gets one of its own (batch/relion_table.h). It reads the states and
/// the metrics of the jobs, so that any process can write it at any time. They appear together.
/// Does nothing but warn if they cannot be written: the results do not depend on them. Waits for
/// another process that writes them.
void write_summary(const std::filesystem::path& folder, const std::vector<Job>& jobs);

/// Tells whether a folder has a summary.csv of a batch.
bool has_summary(const std::filesystem::path& folder);

/// Returns the files of the summary.
std::filesystem::path summary_table(const std::filesystem::path& folder);
std::filesystem::path summary_page(const std::filesystem::path& folder);

}  // namespace tomofield::batch
