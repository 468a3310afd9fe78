#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// Returns the path of the tomograms.star of a batch, in its folder.
std::filesystem::path relion_table(const std::filesystem::path& folder);

/// Tells whether the file of this name is of a batch: each of its rows names the same volume as the
/// tomogram and as the denoised one.
bool has_relion_table(const std::filesystem::path& folder);

/// Returns RELION's name of the tomogram in the row beside the result of a job, or an empty text if
/// there is no row.
std::string tomogram_of_result(const Job& job);

/// Warns of jobs whose rows have the same name, which a table cannot hold: it is not written.
void warn_of_equal_tomograms(const std::vector<Job>& jobs);

/// Writes a tomograms.star with the rows that the runs of finished jobs have written beside their
/// tomograms (exchange/relion_output.h), with all columns. A job without such a row has none. If
/// no job has one, or two have the same name, removes an older table that names a result of `all`.
/// An active io::OutputSet gives the file its name. Throws Error if it cannot be written.
void write_relion_table(const std::filesystem::path& folder, const std::vector<Job>& all,
                        const std::vector<Job>& finished);

}  // namespace tomofield::batch
