#include "batch/job.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "io/images/mrc.h"
#include "io/saving/output_lock.h"
#include "output/output_paths.h"
#include "record/run_summary_record.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

// Returns the usual files of a job that are there.
std::vector<fs::path> files_of(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  std::vector<fs::path> files{paths.volume,         paths.model,
                              paths.json,           paths.report,
                              paths.choice_picture, paths.dial_picture,
                              paths.prior_picture,  paths.trials,
                              paths.alignment,      paths.alignment_picture,
                              paths.tiles};
  for (const fs::path& picture : paths.pictures()) files.push_back(picture);
  std::erase_if(files, [](const fs::path& file) { return !fs::exists(file); });
  return files;
}

}  // namespace

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

std::string fault_of_results(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  try {
    const io::MrcReader tomogram(paths.volume);
  } catch (const Error& error) {
    return error.what();
  }
  try {
    record::read_summary(paths.json);
  } catch (const Error& error) {
    return fmt::format("'{}' is not what a run writes of itself ({})", paths.json.string(),
                       error.what());
  }
  return {};
}

std::string advice_on_files(const fs::path& output) {
  std::vector<std::string> names;
  for (const fs::path& file : files_of(output))
    names.push_back(fmt::format("'{}'", file.filename().string()));
  if (names.empty()) names.emplace_back("its files");
  return fmt::format("remove {} from '{}', and the batch runs this series again, or leave it out",
                     fmt::join(names, ", "), fs::absolute(output).parent_path().string());
}

std::string reason_in_batch(const std::string& said, const fs::path& output) {
  std::size_t advice = said.npos;
  // A name or a value that the message quotes may have the option in it, too.
  for (const char* phrase :
       {"give --overwrite", "or --overwrite to replace", "--overwrite starts over"})
    advice = std::min(advice, said.find(phrase));
  if (advice == said.npos) return said;
  // Adding 1 makes the end of a clause that is not there the smallest.
  const std::size_t end = std::max(said.rfind(": ", advice) + 1, said.rfind("; ", advice) + 1) - 1;
  return fmt::format("{}: {}", said.substr(0, end), advice_on_files(output));
}

std::optional<fs::file_time_type> last_progress(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  std::optional<fs::file_time_type> last;
  for (const fs::path& file : {paths.model, paths.trials, paths.tiles, paths.alignment}) {
    std::error_code error;
    const fs::file_time_type written = fs::last_write_time(file, error);
    if (!error) last = std::max(last.value_or(written), written);
  }
  return last;
}

bool has_checkpoint(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  return fs::exists(paths.model) || fs::exists(paths.trials);
}

bool can_resume(const fs::path& output) {
  const output::OutputPaths paths = output::output_paths(output);
  return has_checkpoint(output) || fs::exists(paths.alignment) || io::has_lock_file(paths.volume);
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
