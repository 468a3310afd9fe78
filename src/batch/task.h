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

/// Runs one job of a list, counted from 1, as a task of a job array, and writes the summary of all.
/// The job gets the threads and the memory that Slurm grants. If `time_is_up` says that the time
/// limit is near, it saves its checkpoint and submits itself again. A task that had too little time
/// for a checkpoint fails instead: it would come no further the next time. Throws Error for a
/// number that is not in the list.
TaskResult run_task(const RunOptions& options, const JobList& list, int number, int threads,
                    const std::function<bool()>& time_is_up);

}  // namespace tomofield::batch
