#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/system/child_process.h"
#include "batch/job.h"
#include "batch/packing.h"
#include "batch/state_record.h"

namespace tomofield::batch {

struct RunOptions {
  std::filesystem::path program;  ///< tomofield itself
  std::filesystem::path folder;   ///< of the batch
  std::function<bool()> stop_requested;
  std::function<void(const Job& job, int threads)> job_starts;
  std::function<void(const Job& job, const State& state)> job_ends;
};

/// A job that runs as a process of its own, with its state on the disk.
class RunningJob {
 public:
  /// Starts the job. It continues from its checkpoint if an earlier session left one. Throws Error
  /// if it cannot be started.
  RunningJob(const RunOptions& options, const Job& job, int threads);

  const Job& job() const { return *job_; }
  int threads() const { return threads_; }
  void ask_to_stop() { child_.ask_to_stop(); }
  /// Returns whether the job has ended, and then writes its state.
  bool has_ended();
  const State& state() const { return session_.state; }

 private:
  struct Session {
    bool resumes = false;
    State state;  // with the costs of the sessions that it continues
  };
  static Session begin(const RunOptions& options, const Job& job);

  const RunOptions* options_;
  const Job* job_;
  int threads_;
  Session session_;
  base::ChildProcess child_;
};

/// Runs all jobs that are not skipped, the largest first, as many at once as `room` holds, and
/// writes the summary whenever one ends. A job that fails does not stop the others. Returns false
/// if it was asked to stop; then all running jobs have saved their checkpoints.
bool run_jobs(const RunOptions& options, const std::vector<Job>& jobs, const Room& room);

}  // namespace tomofield::batch
