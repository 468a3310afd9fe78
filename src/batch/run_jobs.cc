#include "batch/run_jobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <memory>

#include "base/log.h"
#include "batch/summary.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

// Keeps the state of a job that has ended. One that cannot be written must not stop the others.
void write_state_or_warn(const fs::path& folder, const Job& job, const State& state) {
  try {
    write_state(folder, job, state);
  } catch (const Error& error) {
    base::log_warning(fmt::format("the state of '{}' is not kept: {}", job.name, error.what()));
  }
}

bool was_stopped(int status) {  // with a checkpoint
  return status == 128 + SIGTERM || status == 128 + SIGINT || status == 128 + SIGHUP;
}

// Starts the run of a job. One that cannot start fails alone: returns null then.
std::unique_ptr<RunningJob> begin_job(const RunOptions& options, const Job& job, int threads) {
  try {
    return std::make_unique<RunningJob>(options, job, threads);
  } catch (const Error& error) {
    const State failed{.progress = Progress::kFailed, .reason = error.what(), .costs = {}};
    write_state_or_warn(options.folder, job, failed);
    options.job_ends(job, failed);
    return nullptr;
  }
}

}  // namespace

RunningJob::Session RunningJob::begin(const RunOptions& options, const Job& job) {
  const State before = read_state(options.folder, job);
  Session session{.resumes = continues(before, job), .state = {}};
  if (session.resumes) session.state.costs = before.costs;
  session.state.old_checkpoint_ns =
      has_begun(before) ? before.old_checkpoint_ns : checkpoint_time_ns(job);
  session.state.progress = Progress::kRunning;
  write_state(options.folder, job, session.state);
  return session;
}

RunningJob::RunningJob(const RunOptions& options, const Job& job, int threads)
    : options_(&options),
      job_(&job),
      threads_(threads),
      session_(begin(options, job)),
      child_(command_of(options.program, job, threads,
                        {.resumes = session_.resumes, .overwrites = job.replaces}),
             log_of(options.folder, job)) {}

bool RunningJob::has_ended() {
  const auto result = child_.poll();
  if (!result) return false;
  State& state = session_.state;
  state.costs = state.costs + result->costs;
  if (result->exit_status == 0 && has_results(job_->output)) {
    state.progress = Progress::kDone;
  } else if (result->exit_status == 0) {
    state.progress = Progress::kFailed;
    state.reason = fmt::format("the run ended without its results, '{}' and its metrics",
                               job_->output.string());
  } else if (was_stopped(result->exit_status)) {
    state.progress = Progress::kStopped;
    const fs::path log = log_of(options_->folder, *job_);
    state.reason = base::reason_of_failure(log);
    if (state.reason.empty())  // it ended before it could be asked to stop
      state.reason = base::reason_of_failure(result->exit_status, log);
  } else {
    state.progress = Progress::kFailed;
    state.reason = base::reason_of_failure(result->exit_status, log_of(options_->folder, *job_));
    if (!job_->replaces) state.reason = reason_in_batch(state.reason, job_->output);
  }
  write_state_or_warn(options_->folder, *job_, state);
  return true;
}

bool run_jobs(const RunOptions& options, const std::vector<Job>& jobs, const Room& room) {
  std::vector<std::size_t> waiting = largest_first(jobs);
  std::vector<std::unique_ptr<RunningJob>> running;
  Room free = room;
  const auto take = [&](const Job& job, int threads, int sign) {
    free.threads -= sign * threads;
    free.memory_bytes -= sign * job.needs.memory_bytes(threads);
    free.jobs -= sign;
  };
  const auto must_stop = [&] { return options.stop_requested && options.stop_requested(); };
  bool is_stopped = must_stop(), are_all_done = true;
  while (!running.empty() || (!waiting.empty() && !is_stopped)) {
    const auto starts =
        is_stopped ? std::vector<Start>{} : choose_starts(jobs, waiting, free, running.empty());
    for (const Start& start : starts) {
      const Job& job = jobs[start.job];
      options.job_starts(job, start.threads);
      std::erase(waiting, start.job);
      if (auto begun = begin_job(options, job, start.threads)) {
        running.push_back(std::move(begun));
        take(job, start.threads, 1);
      }
    }
    if (!starts.empty()) write_summary(options.folder, jobs);
    if (is_stopped)
      for (const auto& job : running) job->ask_to_stop();
    const auto has_ended = [&](const std::unique_ptr<RunningJob>& job) {
      if (!job->has_ended()) return false;
      take(job->job(), job->threads(), -1);
      options.job_ends(job->job(), job->state());
      are_all_done = are_all_done && job->state().progress == Progress::kDone;
      return true;
    };
    if (std::erase_if(running, has_ended) > 0)
      write_summary(options.folder, jobs);
    else
      base::pause_between_polls();
    is_stopped = must_stop();  // a terminal stops the runs, too, and perhaps the last ones first
  }
  return waiting.empty() && (are_all_done || !is_stopped);
}

}  // namespace tomofield::batch
