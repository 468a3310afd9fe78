#include <fmt/format.h>

#include "base/plausible.h"
#include "base/utf8.h"
#include "batch/job.h"
#include "io/json.h"
#include "tomofield/error.h"

// The list of a batch (batch.json).
namespace tomofield::batch {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::int64_t kMostBytes = std::int64_t{1} << 60;
constexpr double kMostSamples = 1e30;
constexpr std::int64_t kMostTrials = 1 << 20;

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

std::string checked_text(const std::string& text) {
  if (base::utf8_text(text) == text) return text;
  throw Error(
      fmt::format("'{}' is not UTF-8, and the list of a batch cannot hold it: give the file or "
                  "the folder another name",
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
          {"joined", job.is_joined},
          {"replaces", job.replaces},
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

// Returns the name of a series. Files of a batch are called after it, so it names no other folder.
std::string name_at(const json& object) {
  auto name = object.at("name").get<std::string>();
  if (!name.empty() && name != "." && name != ".." && fs::path(name).filename() == name)
    return name;
  throw Error(fmt::format("a series cannot be called '{}'", name));
}

Job job_from(const json& object) {
  return {.name = name_at(object),
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
          .files = {},
          .is_joined = object.at("joined").get<bool>(),
          .replaces = object.at("replaces").get<bool>()};
}

}  // namespace

void require_words(const JobList& list) {
  for (const Job& job : list.jobs) job_json(job);
}

void write_jobs(const fs::path& file, const JobList& list) {
  json jobs = json::array();
  for (const Job& job : list.jobs) jobs.push_back(job_json(job));
  io::write_json(file, {{"tomofield", TOMOFIELD_VERSION},
                        {"overwrites", list.overwrites},
                        {"began_ns", list.began_ns},
                        {"chooses", list.chooses},
                        {"jobs", jobs}});
}

JobList read_jobs(const fs::path& file) {
  const auto read = [](const json& document) {
    JobList list;
    list.overwrites = document.at("overwrites").get<bool>();
    list.began_ns = io::integer_at(document, "began_ns", 0, INT64_MAX);
    list.chooses = document.value("chooses", false);
    for (const json& job : document.at("jobs")) list.jobs.push_back(job_from(job));
    return list;
  };
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format("'{}' is not the list of a batch: {}", file.string(), why);
  });
}

std::vector<Job> find_jobs(const fs::path& file) {
  try {
    return read_jobs(file).jobs;
  } catch (const Error&) {
    return {};
  }
}

std::map<std::string, std::vector<std::string>> read_commands(const fs::path& file) {
  const auto read = [](const json& list) {
    std::map<std::string, std::vector<std::string>> commands;
    for (const json& job : list.at("jobs"))
      commands[job.at("name").get<std::string>()] =
          job.at("command").get<std::vector<std::string>>();
    return commands;
  };
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format(
        "'{}' is not the list of a batch ({}), which says with what its series have begun: remove "
        "it, and these series take the choice of this batch, or start over with --overwrite",
        file.string(), why);
  });
}

}  // namespace tomofield::batch
