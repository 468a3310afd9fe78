#include "batch/own_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <string>

#include "batch/choice.h"
#include "batch/make_choice.h"
#include "batch/relion_table.h"
#include "batch/slurm.h"
#include "batch/state_record.h"
#include "batch/summary.h"
#include "io/is_file.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

// A file of the batch, and whether the one that is there is of an earlier batch.
struct OwnFile {
  fs::path path;
  std::function<bool()> is_of_batch;
};

// Returns the names of the series of an earlier batch, or none if it has no list that can be read.
std::set<std::string> earlier_series(const fs::path& folder) {
  std::set<std::string> names;
  for (const Job& job : find_jobs(list_of(folder))) names.insert(job.name);
  return names;
}

bool is_choice(const fs::path& folder) {
  try {
    return read_choice(folder).has_value();
  } catch (const Error&) {
    return false;
  }
}

std::vector<OwnFile> own_files(const fs::path& folder, const std::vector<Job>& jobs) {
  const std::set<std::string> earlier = earlier_series(folder);
  // Every batch has its list and its summary, and one of them may be damaged.
  const auto of_batch = [folder, has_list = !earlier.empty()] {
    return has_list || has_summary(folder);
  };
  std::vector<OwnFile> files{{list_of(folder), of_batch},
                             {summary_table(folder), [folder] { return has_summary(folder); }},
                             {summary_page(folder), of_batch},
                             {answer_of(folder, std::nullopt), of_batch},
                             {answer_of(folder, kChoosingTask), of_batch},
                             {choice_file(folder), [folder] { return is_choice(folder); }},
                             {script_of(folder), [folder] { return has_script(folder); }}};
  if (std::ranges::any_of(jobs, &Job::is_joined))
    files.push_back({relion_table(folder), [folder] { return has_relion_table(folder); }});
  for (const Job& job : jobs) {
    const auto of_series = [folder, &job, is_earlier = earlier.contains(job.name)] {
      return is_earlier || has_state(folder, job);
    };
    const auto [answer, log] = trial_files_of(folder, job);
    for (const fs::path& path : {log_of(folder, job), state_file_of(folder, job), answer, log})
      files.push_back({path, of_series});
  }
  return files;
}

}  // namespace

std::vector<fs::path> files_of_batch(const fs::path& folder, const std::vector<Job>& jobs) {
  std::vector<fs::path> paths;
  for (const OwnFile& file : own_files(folder, jobs)) paths.push_back(file.path);
  return paths;
}

void require_own_files(const std::vector<Job>& jobs, const PlanOptions& options) {
  for (const auto& [path, is_of_batch] : own_files(options.folder, jobs)) {
    if (!io::is_file(path) || is_of_batch()) continue;
    if (options.skips_existing && path == choice_file(options.folder)) continue;
    throw Error(fmt::format(
        "'{}' is not of an earlier batch, and a batch writes or removes a file of this name: give "
        "another folder with --output, or move the file",
        path.string()));
  }
}

}  // namespace tomofield::batch
