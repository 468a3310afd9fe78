#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "batch/job.h"

namespace tomofield::batch {

/// The resources that Slurm grants to the job in which this process runs.
struct SlurmGrant {
  std::optional<int> threads;                ///< SLURM_CPUS_PER_TASK
  std::optional<std::int64_t> memory_bytes;  ///< SLURM_MEM_PER_NODE, or _PER_CPU times the threads
};
/// Reads the environment. A process outside of Slurm gets no grant.
SlurmGrant slurm_grant();

/// Seconds before the time limit at which a task is told to save its checkpoint (SIGUSR1).
inline constexpr int kWarningSeconds = 120;

/// The options of the tasks of a job array.
struct SlurmOptions {
  std::filesystem::path program;  ///< tomofield itself
  std::filesystem::path folder;   ///< of the batch, with the list of its jobs
  int threads = 1;                ///< CPUs of a task
  std::int64_t began_ns = 0;      ///< of the list of its jobs
  std::vector<std::string> more;  ///< lines of options for sbatch; they go before the usual ones
};

/// Returns the batch script of a job array with a task for every job that is not skipped. All tasks
/// get the memory of the largest job, and three times the estimated time of the longest. Throws
/// Error if that is not known and `more` gives none.
std::string slurm_script(const SlurmOptions& options, const std::vector<Job>& jobs);

/// Returns the file of the script, and the list of jobs that its tasks read.
std::filesystem::path script_of(const std::filesystem::path& folder);
std::filesystem::path list_of(const std::filesystem::path& folder);

/// Tells whether the file that is called as the script is a script of a batch.
bool has_script(const std::filesystem::path& folder);

/// The task that makes the choice for all series (make_choice.h); the jobs are counted from 1.
inline constexpr int kChoosingTask = 0;

/// Returns the file of what sbatch answers about all tasks, or about one.
std::filesystem::path answer_of(const std::filesystem::path& folder, std::optional<int> task);

/// Throws Error unless this machine has sbatch.
void require_sbatch();

/// Submits the script with sbatch: all of its tasks, or one of them. They begin when the Slurm job
/// `after` has ended, in whatever way, if it is not empty. Returns the number of the Slurm job.
/// Throws Error with what sbatch says if that fails, or if it answers no number, and
/// base::StopRequested if `stop_requested` becomes true before sbatch has taken the job.
std::string submit(const std::filesystem::path& folder, std::optional<int> task = std::nullopt,
                   const std::string& after = {}, const std::function<bool()>& stop_requested = {});

}  // namespace tomofield::batch
