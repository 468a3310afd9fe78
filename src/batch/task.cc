#include "batch/task.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "base/log.h"
#include "batch/choice.h"
#include "batch/slurm.h"
#include "batch/summary.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

constexpr double kGibibyte = 1 << 30;

// Returns why a job does not get enough memory, or an empty text.
std::string memory_fault(const Job& job, int threads) {
  const auto granted = slurm_grant().memory_bytes;
  const std::int64_t needed = job.needs.memory_bytes(threads);
  if (!granted || needed <= *granted) return {};
  return fmt::format(
      "it needs about {:.1f} GiB of memory on {} threads, and Slurm grants {:.1f} GiB "
      "(SLURM_MEM_PER_NODE): give more with --sbatch '--mem=…'",
      static_cast<double>(needed) / kGibibyte, threads, static_cast<double>(*granted) / kGibibyte);
}

State run_to_the_end(const RunOptions& options, const JobList& list, const Job& job, int threads,
                     const std::function<bool()>& time_is_up) {
  RunningJob running(options, job, threads);
  write_summary(options.folder, list.jobs);
  while (!running.has_ended()) {
    if (time_is_up() || options.stop_requested()) running.ask_to_stop();
    base::pause_between_polls();
  }
  return running.state();
}

// Submits a task again whose time is up, and says who goes on.
void submit_again(const fs::path& folder, int number, TaskResult& result) {
  try {
    result.continued_by = submit(folder, number);
    result.state.reason =
        fmt::format("its time limit came; Slurm job {} goes on", result.continued_by);
  } catch (const Error& error) {
    result.state.reason = fmt::format(
        "its time limit came, and no task goes on: {}; the batch with --resume does", error.what());
  }
}

}  // namespace

void require_same_batch(const fs::path& file, const JobList& list,
                        std::optional<std::int64_t> began_ns) {
  if (!began_ns || *began_ns == list.began_ns) return;
  throw Error(
      fmt::format("'{}' is the list of another batch, which has begun in this folder since this "
                  "task was submitted: the task makes nothing. Submit its series again, in a "
                  "folder of their own",
                  file.string()));
}

TaskResult run_task(const RunOptions& options, const JobList& list, int number, int threads,
                    const std::function<bool()>& time_is_up) {
  if (number < 1 || number > std::ssize(list.jobs))
    throw Error(
        fmt::format("there is no task {}: the batch has {} series", number, list.jobs.size()));
  const Job& job = list.jobs[static_cast<std::size_t>(number - 1)];
  const auto before = last_progress(job.output);
  TaskResult result;
  if (std::string fault = memory_fault(job, threads); !fault.empty())
    result.state = {.progress = Progress::kFailed, .reason = std::move(fault), .costs = {}};
  else
    result.state = run_to_the_end(options, list, job, threads, time_is_up);
  if (result.state.progress == Progress::kStopped && time_is_up()) {
    if (last_progress(job.output) <= before) {
      result.state.progress = Progress::kFailed;
      result.state.reason =
          "its time limit came before the first checkpoint: give more with --sbatch '--time=…'";
    } else {
      require_same_batch(list_of(options.folder), read_jobs(list_of(options.folder)),
                         list.began_ns);  // the script that goes on is of the same batch
      submit_again(options.folder, number, result);
    }
  }
  if (result.state.progress == Progress::kDone && list.chooses && !read_choice(options.folder))
    result.state.reason =
        "the task that chooses for all series made no choice, so this series chose for itself";
  write_state(options.folder, job, result.state);
  write_summary(options.folder, list.jobs);
  return result;
}

}  // namespace tomofield::batch
