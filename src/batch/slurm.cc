#include "batch/slurm.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "base/code_text.h"
#include "base/plausible.h"
#include "base/progress.h"
#include "base/system/child_process.h"
#include "batch/packing.h"
#include "batch/state_record.h"
#include "io/file_start.h"
#include "io/is_file.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMebibyte = std::int64_t{1} << 20;
constexpr double kMoreMemory = 1.2;  // estimates are within 10 %
constexpr double kMoreTime = 3;      // nodes differ, and others use them too
constexpr double kLeastMinutes = 15;
constexpr std::int64_t kMostJobs = UINT32_MAX;  // the numbers of jobs have 32 bits

// Returns a whole number of the environment from 1 to `most`.
std::optional<std::int64_t> number_in_environment(const char* name, std::int64_t most) {
  const char* text = std::getenv(name);
  const auto number = text == nullptr ? std::nullopt : io::parse_integer(text);
  return number && *number > 0 && *number <= most ? number : std::nullopt;
}

using Script = base::CodeText<base::Shell>;

// Returns the tasks of an array, counted from 1, as Slurm reads them: "1,3,4".
Script array_of(const std::vector<Job>& jobs) {
  std::vector<std::size_t> numbers;
  for (const std::size_t job : largest_first(jobs)) numbers.push_back(job + 1);
  std::ranges::sort(numbers);
  return Script::made(fmt::format("{}", fmt::join(numbers, ",")));
}

std::int64_t memory_MiB(const std::vector<Job>& jobs, int threads) {
  std::int64_t most = 0;
  for (const Job& job : jobs) most = std::max(most, job.needs.memory_bytes(threads));
  return static_cast<std::int64_t>(kMoreMemory * static_cast<double>(most)) / kMebibyte + 256;
}

// Returns the time of the longest job, or nothing if that of one is not known.
std::optional<double> minutes(const std::vector<Job>& jobs, int threads) {
  double most = 0;
  for (const std::size_t job : largest_first(jobs)) {
    const auto core_seconds = jobs[job].needs.core_seconds;
    if (!core_seconds) return std::nullopt;
    most = std::max(most, *core_seconds / threads / 60);
  }
  return std::ceil(kLeastMinutes + kMoreTime * most);
}

bool gives_time(const std::string& option) {
  return option.starts_with("--time") || option.starts_with("-t") ||
         option.find(" --time") != std::string::npos || option.find(" -t") != std::string::npos;
}

// Returns a name in an option of sbatch, which knows no quotes and reads % as a pattern. A line end
// in a name would be a command of the script.
Script name_for_sbatch(const fs::path& path, std::string_view advice) {
  const std::string name = path.string();
  const auto is_safe = [](unsigned char c) {
    return c > ' ' && c != 0x7f &&
           std::string_view("\"'\\%#").find(char(c)) == std::string_view::npos;
  };
  if (std::ranges::all_of(name, is_safe)) return Script::made(name);
  throw Error(
      fmt::format("{} cannot be named in a script for sbatch: {} without spaces, line ends, "
                  "quotes, '\\', '%' and '#' in its path",
                  io::quote(name), advice));
}

// Tells whether a word names an option of sbatch that the batch sets itself. sbatch takes the
// beginning of a name for it, and a value right behind a letter.
bool is_own_option(std::string_view word) {
  constexpr std::array<std::string_view, 9> kOwn{"--array",     "--ntasks",   "--chdir",
                                                 "--output",    "--signal",   "--wrap",
                                                 "--test-only", "--parsable", "--dependency"};
  constexpr std::string_view kLetters = "anDod";  // of the same
  constexpr std::size_t kShortest = 4;            // "--ar"
  if (word.starts_with("--")) {
    const std::string_view name = word.substr(0, word.find('='));
    const auto begins = [&](std::string_view own) {
      return name.size() >= kShortest && own.starts_with(name);
    };
    return std::ranges::any_of(kOwn, begins);
  }
  return word.size() > 1 && word[0] == '-' && kLetters.find(word[1]) != std::string_view::npos;
}

// Returns an option of the user for sbatch, which is one line of the script.
Script line_for_sbatch(const std::string& option) {
  for (const std::string_view word : io::split_words(option))
    if (is_own_option(word))
      throw Error(fmt::format("--sbatch {}: the batch sets {} itself, so leave it out",
                              io::quote(option), io::quote(word.substr(0, word.find('=')))));
  if (std::ranges::none_of(option, [](unsigned char c) { return c < ' ' || c == 0x7f; }))
    return Script::made(option);
  throw Error(
      fmt::format("{} cannot be an option for sbatch: it has a line end or another "
                  "control character",
                  io::quote(option)));
}

// The first lines of the script.
constexpr std::string_view kFirstLine = "#!/bin/sh\n", kFirstOption = "--job-name=tomofield";

// Returns what sbatch said, or the beginning of an answer that is long.
std::string answer_in(const fs::path& file) {
  std::string said(1 << 16, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(said.data(), std::ssize(said));
  said.resize(static_cast<std::size_t>(stream.gcount()));
  return std::string(io::trim(said));
}

// Returns the number of the job in what sbatch says, the last line of the form NUMBER or
// NUMBER;CLUSTER. Notes of the site may stand around it.
std::optional<std::string> job_number_in(std::string_view said) {
  std::optional<std::string> found;
  while (!said.empty()) {
    const std::size_t end = std::min(said.find('\n'), said.size());
    const std::string_view line = io::trim(said.substr(0, end));
    const auto number = io::parse_integer(line.substr(0, line.find(';')));
    if (number && *number > 0 && *number <= kMostJobs) found = std::to_string(*number);
    said.remove_prefix(std::min(end + 1, said.size()));
  }
  return found;
}

}  // namespace

SlurmGrant slurm_grant() {
  if (std::getenv("SLURM_JOB_ID") == nullptr) return {};
  constexpr std::int64_t kMostThreads = 1 << 20, kMostMebibytes = std::int64_t{1} << 40;
  SlurmGrant grant;
  if (const auto cpus = number_in_environment("SLURM_CPUS_PER_TASK", kMostThreads))
    grant.threads = static_cast<int>(*cpus);
  if (const auto of_node = number_in_environment("SLURM_MEM_PER_NODE", kMostMebibytes))
    grant.memory_bytes = *of_node * kMebibyte;
  else if (const auto of_cpu = number_in_environment("SLURM_MEM_PER_CPU", kMostMebibytes))
    grant.memory_bytes =
        (base::CheckedSize(*of_cpu) * kMebibyte * grant.threads.value_or(1)).find();
  return grant;
}

fs::path script_of(const fs::path& folder) { return folder / "batch.sbatch"; }
fs::path list_of(const fs::path& folder) { return folder / "batch.json"; }

fs::path answer_of(const fs::path& folder, std::optional<int> task) {
  return log_folder(folder) / (task ? fmt::format("sbatch-{}.out", *task) : "sbatch.out");
}

bool has_script(const fs::path& folder) {
  return io::begins_with(script_of(folder),
                         fmt::format("{}#SBATCH {}\n", kFirstLine, kFirstOption));
}

std::string slurm_script(const SlurmOptions& options, const std::vector<Job>& jobs) {
  const fs::path logs = fs::absolute(log_folder(options.folder));
  Script script = Script::made(std::string(kFirstLine));
  // If an option comes twice, sbatch takes the last.
  const auto add = [&](const Script& option) { script += Script::format("#SBATCH {}\n", option); };
  const auto word = [](const fs::path& path) { return Script::of(path.string()); };
  add(Script::made(std::string(kFirstOption)));
  add(Script::format("--cpus-per-task={}", options.threads));
  add(Script::format("--mem={}M", memory_MiB(jobs, options.threads)));
  if (const auto time = minutes(jobs, options.threads))
    add(Script::format("--time={:.0f}", *time));
  else if (std::ranges::none_of(options.more, gives_time))
    throw Error(
        "the processor time of a series is not known (--engine ray, or leaves above 256 pixels), "
        "so give the limit of the tasks: --sbatch '--time=…'");
  for (const std::string& option : options.more) add(line_for_sbatch(option));
  add(Script::format("--array={}", array_of(jobs)));
  add("--ntasks=1");
  add(Script::format("--chdir={}",
                     name_for_sbatch(fs::current_path(), "start the command in a folder")));
  add(Script::format("--output={}/slurm-%A_%a.out", name_for_sbatch(logs, "give -o a folder")));
  add(Script::format("--signal=B:USR1@{}", kWarningSeconds));
  script +=
      Script::format("exec {} batch {} --output {} --began {} --task \"$SLURM_ARRAY_TASK_ID\"\n",
                     word(options.program), word(fs::absolute(list_of(options.folder))),
                     word(fs::absolute(options.folder)), options.began_ns);
  return script.text();
}

void require_sbatch() {
  const char* const path = std::getenv("PATH");
  std::string_view folders = path == nullptr ? "" : path;
  while (!folders.empty()) {
    const std::size_t colon = std::min(folders.find(':'), folders.size());
    const fs::path program = fs::path(folders.substr(0, colon)) / "sbatch";
    if (io::is_file(program) && access(program.c_str(), X_OK) == 0) return;
    folders.remove_prefix(std::min(colon + 1, folders.size()));
  }
  throw Error("sbatch is not there: --slurm needs a machine from which jobs are submitted");
}

std::string submit(const fs::path& folder, std::optional<int> task, const std::string& after,
                   const std::function<bool()>& stop_requested) {
  std::vector<std::string> command{"/usr/bin/env", "sbatch", "--parsable"};
  if (task) command.push_back(fmt::format("--array={}", *task));
  if (!after.empty()) command.push_back("--dependency=afterany:" + after);
  command.push_back(fs::absolute(script_of(folder)).string());
  const fs::path answer = answer_of(folder, task);
  const base::ChildResult result = base::run_child(command, answer, stop_requested);
  const std::string said = answer_in(answer);
  if (result.exit_status != 0 && stop_requested && stop_requested()) throw base::StopRequested();
  if (result.exit_status == 127)
    throw Error("sbatch is not there: --slurm needs a machine from which jobs are submitted");
  if (result.exit_status != 0)
    throw Error(
        fmt::format("sbatch refused '{}': {}", script_of(folder).string(),
                    said.empty() ? base::reason_of_failure(result.exit_status, answer) : said));
  if (const auto number = job_number_in(said)) return *number;
  throw Error(fmt::format(
      "sbatch was given '{}' and answered '{}', in which no line is the number of a job: look with "
      "squeue whether it was taken",
      script_of(folder).string(), io::quote(said)));
}

}  // namespace tomofield::batch
