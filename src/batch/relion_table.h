#pragma once

#include <filesystem>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// Returns the path of the tomograms.star of a batch, in its folder.
std::filesystem::path relion_table(const std::filesystem::path& folder);

/// Returns true if jobs reconstruct series of a STAR file, so that their batch has a
/// tomograms.star.
bool are_of_star_files(const std::vector<Job>& jobs);

/// Writes a tomograms.star with the rows that the runs of these jobs have written beside their
/// tomograms (exchange/relion_output.h), with all columns. A job without such a row has none. If
/// no job has one, removes an older file. An active io::OutputSet gives the file its name. Throws
/// Error if it cannot be written.
void write_relion_table(const std::filesystem::path& folder, const std::vector<Job>& finished);

}  // namespace tomofield::batch
