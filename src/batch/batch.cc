#include "batch/batch.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <system_error>

#include "base/log.h"
#include "base/system/memory.h"
#include "batch/choice.h"
#include "batch/file_conflicts.h"
#include "batch/relion_table.h"
#include "batch/series_list.h"
#include "batch/slurm.h"
#include "batch/state_record.h"
#include "batch/summary.h"
#include "io/is_file.h"
#include "io/saving/output_files.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

constexpr double kGibibyte = 1 << 30;

// Names the series of an earlier batch by Slurm that are not at their end and not in the new list:
// tasks that still wait for them make nothing.
void warn_of_waiting_tasks(const fs::path& folder, const JobList& list) {
  if (!has_script(folder)) return;
  std::vector<std::string> waiting;
  for (const Job& job : find_jobs(list_of(folder))) {
    const State state = read_state(folder, job);
    if ((state.progress == Progress::kWaiting || has_begun(state)) &&
        std::ranges::find(list.jobs, job.output, &Job::output) == list.jobs.end())
      waiting.push_back(job.name);
  }
  if (waiting.empty()) return;
  base::log_warning(
      fmt::format("an earlier batch in '{}' was given to Slurm and has not finished {}: its tasks "
                  "that still wait make nothing, so submit these series again in another folder",
                  folder.string(), fmt::join(waiting, ", ")));
}

}  // namespace

void settle_outputs(std::vector<Series>& all, const PlanOptions& options, base::Faults& faults) {
  std::vector<fs::path> inputs, outputs;
  for (Series& series : all) {
    faults.collect([&] { series.output = output_of(series, options.folder); });
    outputs.push_back(series.output);
    if (io::is_file(series.input)) inputs.push_back(series.input);
  }
  // The batch has the lock of its list, which the run of the series would meet.
  std::error_code failed;
  const fs::path list = fs::weakly_canonical(list_of(options.folder), failed);
  for (const Series& series : all)
    if (fs::weakly_canonical(series.output, failed) == list)
      faults.add(
          fmt::format("{}: the batch itself and this series would both write '{}': give the "
                      "series another output",
                      series.source, series.output.string()));
  check_names(all, faults);
  check_placeholders(all, options.common, faults);
  check_tomograms(all, options.common, faults);
  faults.collect([&] { io::require_no_input_is_replaced(outputs, inputs); });
  if (options.skips_existing || options.overwrites) return;
  for (const Series& series : all) {
    if (fs::exists(series.output))
      faults.add(
          fmt::format("{}: '{}' exists: --skip-existing leaves it as it is, --overwrite "
                      "replaces it",
                      series.source, series.output.string()));
  }
}

void require_room(const std::vector<Job>& jobs, const Room& room) {
  base::Faults faults;
  for (const Job& job : jobs) {
    const std::int64_t needed = job.needs.memory_bytes_of_one_thread;
    if (job.is_skipped || needed <= room.memory_bytes) continue;
    faults.add(
        fmt::format("{} needs about {:.1f} GiB of memory, and {:.1f} GiB are there: use a "
                    "larger --bin, a smaller --roi or --thickness, or a larger machine "
                    "(--slurm)",
                    job.name, static_cast<double>(needed) / kGibibyte,
                    static_cast<double>(room.memory_bytes) / kGibibyte));
  }
  require_none(faults);
}

void begin_batch(const fs::path& folder, const JobList& list) {
  warn_of_waiting_tasks(folder, list);
  fs::create_directories(log_folder(folder));
  // The list comes last: with it, results that a state calls done are those of this batch.
  for (const Job& job : list.jobs) {
    State state = read_state(folder, job);
    // A job that a stopped batch had begun, and that replaces results, goes on from its checkpoint.
    const bool goes_on = job.replaces && !list.overwrites && has_begun(state);
    state.progress = job.is_skipped ? Progress::kSkipped
                     : goes_on      ? Progress::kStopped
                                    : Progress::kWaiting;
    state.reason.clear();
    write_state(folder, job, state);
  }
  write_jobs(list_of(folder), list);
  write_summary(folder, list.jobs);
}

std::int64_t memory_for_jobs() {
  constexpr std::int64_t kUnknown = std::numeric_limits<std::int64_t>::max();
  const auto found = base::find_available_memory();
  const std::int64_t free = found ? static_cast<std::int64_t>(found->bytes) : kUnknown;
  return std::min(free, slurm_grant().memory_bytes.value_or(kUnknown));
}

}  // namespace tomofield::batch
