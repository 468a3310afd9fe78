#include "batch/make_choice.h"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "base/log.h"
#include "base/system/child_process.h"
#include "batch/slurm.h"
#include "batch/state_record.h"
#include "batch/summary.h"
#include "tune/trial_record.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

// Lets a job make its trials, and returns its vote.
Vote let_vote(const RunOptions& options, const Job& job, int threads) {
  const auto [answer, log] = trial_files_of(options.folder, job);
  fs::create_directories(log.parent_path());
  fs::remove(answer);
  std::vector<std::string> command = command_of(
      options.program, job, threads, {.resumes = !job.replaces, .overwrites = job.replaces});
  command.push_back("--choice=" + answer.string());
  const base::ChildResult result = base::run_child(command, log, options.stop_requested);
  if (result.exit_status == 0) return vote_of(job, tune::read_choice(answer));
  Vote none;
  none.series = job.name;
  none.failure = base::reason_of_failure(result.exit_status, log);
  return none;
}

}  // namespace

TrialFiles trial_files_of(const fs::path& folder, const Job& job) {
  const fs::path trials = log_folder(folder) / "choice";
  return {.answer = trials / (job.name + ".json"), .log = trials / (job.name + ".log")};
}

bool make_choice(const RunOptions& options, const std::vector<std::size_t>& choosing, int threads,
                 JobList& list) {
  std::vector<Vote> votes;
  for (const std::size_t i : choosing) {
    base::log_info(fmt::format("{}: makes trials that choose for all series", list.jobs[i].name));
    votes.push_back(let_vote(options, list.jobs[i], threads));
    if (options.stop_requested && options.stop_requested()) return false;
    if (!votes.back().is_valid())
      base::log_warning(
          fmt::format("{}: its trials failed: {}", votes.back().series, votes.back().failure));
  }
  const std::optional<Choice> choice = count_votes(std::move(votes));
  if (!choice) {
    base::log_warning("no trials for all series have succeeded: every series chooses for itself");
    return true;
  }
  base::log_info(fmt::format("for all series: {}", describe(*choice)));
  write_choice(options.folder, *choice);
  give_choice(*choice, options.folder, list.jobs);
  write_jobs(list_of(options.folder), list);
  write_summary(options.folder, list.jobs);
  return true;
}

}  // namespace tomofield::batch
