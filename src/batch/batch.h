#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "batch/job.h"
#include "batch/packing.h"
#include "batch/planning.h"
#include "batch/series_list.h"

namespace tomofield::batch {

/// Gives the outputs of all series their names, and checks all that can be checked without running
/// anything: that no two series share a name or an output, that no output is an input, that
/// placeholders stand for something, and, unless existing results are skipped or replaced, that
/// there are none. Adds all mistakes to `faults`.
void settle_outputs(std::vector<Series>& all, const PlanOptions& options, base::Faults& faults);

/// Throws Error with every job that needs more memory than there is, also on one thread.
void require_room(const std::vector<Job>& jobs, const Room& room);

/// Makes the folder of logs, the list of jobs, their first states and the first summary.
void begin_batch(const std::filesystem::path& folder, const JobList& list);

/// Returns the memory that all jobs may use together: what the machine has free, or what Slurm
/// grants if that is less.
std::int64_t memory_for_jobs();

}  // namespace tomofield::batch
