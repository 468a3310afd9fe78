#pragma once

#include <functional>
#include <string>

#include "batch/run_jobs.h"

namespace tomofield::batch {

/// The end of a task of a job array.
struct TaskResult {
  State state;
  std::string continued_by;  ///< the Slurm job that goes on, if the time limit was near
};

/// Throws Error if the list that a file has is of another batch than the one that began at
/// `began_ns`, of which a task was submitted. Nothing: any list.
void require_same_batch(const std::filesystem::path& file, const JobList& list,
                        std::optional<std::int64_t> began_ns);

/// Runs one job of a list, counted from 1, as a task of a job array, and writes the summary of all.
/// The job gets the threads and the memory that Slurm grants. If `time_is_up` says that the time
/// limit is near, it saves its checkpoint and submits itself again. A task that had too little time
/// for a checkpoint fails instead: it would come no further the next time. Throws Error for a
/// number that is not in the list.
TaskResult run_task(const RunOptions& options, const JobList& list, int number, int threads,
                    const std::function<bool()>& time_is_up);

}  // namespace tomofield::batch
