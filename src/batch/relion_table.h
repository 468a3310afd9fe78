#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// Returns the path of the tomograms.star of a batch, in its folder.
std::filesystem::path relion_table(const std::filesystem::path& folder);

/// Tells whether the file of this name is of a batch, as its first line says.
bool has_relion_table(const std::filesystem::path& folder);

/// Returns RELION's name of the tomogram in the row beside the result of a job, or an empty text if
/// there is no row.
std::string tomogram_of_result(const Job& job);

/// Lets the rows of all jobs go to the table of the batch if they are of one table of RELION, from
/// whose project folder their files are named, and have names that differ. Warns if they do not.
void join_rows(std::vector<Job>& jobs);

/// Writes a tomograms.star with the rows that the runs of finished jobs have written beside their
/// tomograms (exchange/relion_output.h), with all columns. A job without such a row has none. If
/// no job has one, removes an older table that names a result of `all`. An active io::OutputSet
/// gives the file its name. Throws Error if it cannot be written.
void write_relion_table(const std::filesystem::path& folder, const std::vector<Job>& all,
                        const std::vector<Job>& finished);

}  // namespace tomofield::batch
