#pragma once

#include <filesystem>
#include <vector>

#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "options/run_options.h"

namespace tomofield::reconstruction {

/// Returns all files that a run may write; none if the options name no output.
std::vector<std::filesystem::path> result_files(const options::ReconstructOptions& options);

/// Returns these, and the pictures that a run with --overwrite removes (remove_stale_files()).
std::vector<std::filesystem::path> replaceable_files(const options::ReconstructOptions& options);

/// Throws Error for faulty options. Throws Error also if a result would replace an input, or an
/// existing file without --overwrite or --resume, or cannot be written at its path. Reads no file.
void check_options(const options::ReconstructOptions& options);

/// Checks the options and locks the files of a run against other runs. The run holds the locks to
/// its end. Returns none if the options name no output. Throws Error as check_options() does, or if
/// another run writes these files, or if the run would continue a model that has no state of a fit.
std::vector<io::OutputLock> claim_outputs(const options::ReconstructOptions& options);

/// Lets `results` remove the pictures that an earlier run of the same name has drawn and this run
/// does not draw, such as that of its trials: they would contradict the new tomogram. Only a run
/// with --overwrite does so. Volumes, models and records stay: they may be another program's. Logs
/// the names. All new files must be in the set.
void remove_stale_files(const options::ReconstructOptions& options, io::OutputSet& results);

}  // namespace tomofield::reconstruction
