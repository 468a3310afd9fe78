#include "batch/job.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/plausible.h"
#include "base/utf8.h"
#include "io/json.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::int64_t kMostBytes = std::int64_t{1} << 60;
constexpr double kMostSamples = 1e30;
constexpr std::int64_t kMostThreads = 1 << 20;
constexpr std::int64_t kMostTrials = 1 << 20;

// Reads a plan or a list of jobs. Mistakes in it are errors that name the file.
template <typename Read>
auto read_job_file(const fs::path& file, const char* what, const Read& read) {
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format("'{}' is not {}: {}", file.string(), what, why);
  });
}

std::int64_t bytes_at(const json& object, const char* key) {
  return io::integer_at(object, key, 0, kMostBytes);
}

std::optional<double> core_seconds_at(const json& object) {
  if (object.at("core_seconds").is_null()) return std::nullopt;
  return io::number_at(object, "core_seconds", 0, base::kLargestNumber);
}

int trials_at(const json& object) {
  return static_cast<int>(io::integer_at(object, "trials", 0, kMostTrials));
}

std::vector<fs::path> files_at(const json& object, const char* key) {
  const auto names = object.at(key).get<std::vector<std::string>>();
  return {names.begin(), names.end()};
}

std::string checked_text(const std::string& text) {
  if (base::utf8_text(text) == text) return text;
  throw Error(
      fmt::format("'{}' is not UTF-8, and the list of a batch cannot hold it: give the file "
                  "another name",
                  text));
}

json job_json(const Job& job) {
  json words = json::array();
  for (const std::string& word : job.command) words.push_back(checked_text(word));
  const Needs& needs = job.needs;
  return {{"name", checked_text(job.name)},
          {"output", checked_text(job.output.string())},
          {"command", words},
          {"skipped", job.is_skipped},
          {"memory_bytes_of_one_thread", needs.memory_bytes_of_one_thread},
          {"memory_bytes_a_thread", needs.memory_bytes_a_thread},
          {"core_seconds", needs.core_seconds ? json(*needs.core_seconds) : json(nullptr)},
          {"sample_steps", needs.sample_steps},
          {"result_bytes", needs.result_bytes},
          {"disk_bytes", needs.disk_bytes},
          {"open_variation", needs.open_variation},
          {"open_spike_rank", needs.open_spike_rank},
          {"open_prior", needs.open_prior},
          {"trials", needs.num_trials}};
}

Job job_from(const json& object) {
  return {.name = object.at("name").get<std::string>(),
          .output = object.at("output").get<std::string>(),
          .command = object.at("command").get<std::vector<std::string>>(),
          .needs = {.memory_bytes_of_one_thread = bytes_at(object, "memory_bytes_of_one_thread"),
                    .memory_bytes_a_thread = bytes_at(object, "memory_bytes_a_thread"),
                    .core_seconds = core_seconds_at(object),
                    .sample_steps = io::number_at(object, "sample_steps", 0, kMostSamples),
                    .result_bytes = bytes_at(object, "result_bytes"),
                    .disk_bytes = bytes_at(object, "disk_bytes"),
                    .open_variation = object.at("open_variation").get<bool>(),
                    .open_spike_rank = object.at("open_spike_rank").get<bool>(),
                    .open_prior = object.at("open_prior").get<bool>(),
                    .num_trials = trials_at(object)},
          .is_skipped = object.at("skipped").get<bool>(),
          .files = {}};
}

}  // namespace

JobPlan read_plan(const fs::path& file) {
  return read_job_file(file, "the plan of a run", [](const json& plan) {
    JobPlan read;
    Needs& needs = read.needs;
    const std::int64_t threads = io::integer_at(plan, "threads", 1, kMostThreads);
    const std::int64_t most = bytes_at(plan, "memory_bytes");
    needs.memory_bytes_of_one_thread = bytes_at(plan, "memory_bytes_of_one_thread");
    if (threads > 1)
      needs.memory_bytes_a_thread =
          std::max(most - needs.memory_bytes_of_one_thread, std::int64_t{0}) / (threads - 1);
    needs.core_seconds = core_seconds_at(plan);
    needs.sample_steps = io::number_at(plan, "sample_steps", 0, kMostSamples);
    needs.result_bytes = bytes_at(plan, "result_bytes");
    needs.disk_bytes = bytes_at(plan, "disk_bytes");
    needs.open_variation = plan.at("open_variation").get<bool>();
    needs.open_spike_rank = plan.at("open_spike_rank").get<bool>();
    needs.open_prior = plan.at("open_prior").get<bool>();
    needs.num_trials = trials_at(plan);
    read.files = {files_at(plan, "inputs"), files_at(plan, "results")};
    return read;
  });
}

std::string read_stack(const fs::path& file) {
  return read_job_file(file, "the plan of a run",
                       [](const json& plan) { return plan.value("stack", std::string()); });
}

void write_jobs(const fs::path& file, const JobList& list) {
  json jobs = json::array();
  for (const Job& job : list.jobs) jobs.push_back(job_json(job));
  io::write_json(
      file, {{"tomofield", TOMOFIELD_VERSION}, {"overwrites", list.overwrites}, {"jobs", jobs}});
}

JobList read_jobs(const fs::path& file) {
  return read_job_file(file, "the list of a batch", [](const json& document) {
    JobList list;
    list.overwrites = document.at("overwrites").get<bool>();
    for (const json& job : document.at("jobs")) list.jobs.push_back(job_from(job));
    return list;
  });
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
