#include "batch/job.h"

#include <fmt/format.h>

#include <algorithm>

#include "output/output_paths.h"

namespace tomofield::batch {

namespace fs = std::filesystem;

Needs needs_of(const record::PlanRecord& plan) {
  const std::int64_t more_threads = plan.num_threads - 1;
  const std::int64_t more_bytes =
      std::max(plan.memory_bytes - plan.memory_bytes_of_one_thread, std::int64_t{0});
  return {.memory_bytes_of_one_thread = plan.memory_bytes_of_one_thread,
          .memory_bytes_a_thread = more_threads > 0 ? more_bytes / more_threads : 0,
          .core_seconds = plan.core_seconds,
          .sample_steps = plan.sample_steps,
          .result_bytes = plan.result_bytes,
          .disk_bytes = plan.disk_bytes,
          .open_variation = plan.open_variation,
          .open_spike_rank = plan.open_spike_rank,
          .open_prior = plan.open_prior,
          .num_trials = plan.num_trials};
}

bool has_results(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  return fs::exists(paths.volume) && fs::exists(paths.json);
}

bool has_checkpoint(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  return fs::exists(paths.model) || fs::exists(paths.trials);
}

bool can_resume(const fs::path& output) {
  return has_checkpoint(output) || fs::exists(output::output_paths(output).alignment);
}

std::vector<std::string> command_of(const fs::path& program, const Job& job, int threads,
                                    EarlierFiles earlier) {
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), job.command.begin(), job.command.end());
  words.push_back(fmt::format("--threads={}", threads));
  if (earlier.resumes && can_resume(job.output))
    words.emplace_back("--resume");
  else if (earlier.overwrites)
    words.emplace_back("--overwrite");
  return words;
}

}  // namespace tomofield::batch
