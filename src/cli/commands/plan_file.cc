#include "cli/commands/plan_file.h"

#include <fmt/format.h>

#include <string>

#include "base/progress.h"
#include "base/threads/parallel.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "exchange/relion_output.h"
#include "io/saving/output_files.h"
#include "plan/plan.h"
#include "reconstruct/run_files.h"
#include "record/plan_record.h"
#include "tilt_series/planned_series.h"

namespace tomofield::cli {
namespace {

constexpr double kGibibyte = 1 << 30;

// Returns the memory of a run on one thread. More threads need more.
std::size_t memory_of_one_thread(const tilt_series::PlannedSeries& series,
                                 const options::ReconstructOptions& options,
                                 const distributed::Communicator& processes) {
  const int threads = base::thread_count();
  base::set_thread_count(1);
  const std::size_t bytes = plan::plan_run(series, options, processes).memory_bytes;
  base::set_thread_count(threads);
  return bytes;
}

// Says whether a run would take a setting that the options leave open from another run. With --tune
// it looks for its own.
bool is_left_to_runs(const options::ReconstructOptions& options, bool is_open) {
  return is_open && !options.fit.tune;
}

// Returns every file that a run reads.
std::vector<std::filesystem::path> inputs_of(const options::ReconstructOptions& options) {
  std::vector<std::filesystem::path> inputs = io::input_files(options.files);
  for (const auto& added : io::added_inputs()) inputs.push_back(added);
  return inputs;
}

record::PlanRecord record_of(const options::ReconstructOptions& options, const plan::RunPlan& plan,
                             const plan::RunEstimate& estimate) {
  const tune::OpenSettings open = options.open_settings();
  return {.stack = std::filesystem::absolute(options.files.stack).lexically_normal().string(),
          .num_views = plan.num_views,
          .view_size_px = {plan.view_width, plan.view_height},
          .pixel_size_A = plan.pixel_size_A,
          .num_parameters = static_cast<std::int64_t>(plan.num_parameters),
          .num_trials = plan.num_trials,
          .open_variation = is_left_to_runs(options, open.variation),
          .open_spike_rank = is_left_to_runs(options, open.spikes),
          .open_prior = is_left_to_runs(options, open.prior),
          .num_steps = plan.num_steps,
          .num_threads = base::thread_count(),
          .memory_bytes = static_cast<std::int64_t>(plan.memory_bytes),
          .core_seconds = estimate.core_seconds,
          .sample_steps = estimate.sample_steps,
          .result_bytes = static_cast<std::int64_t>(estimate.result_bytes),
          .disk_bytes = static_cast<std::int64_t>(estimate.disk_bytes),
          .inputs = inputs_of(options),
          .results = reconstruction::result_files(options),
          .relion_tomogram = exchange::relion_tomogram(options).value_or("")};
}

}  // namespace

void add_plan_option(CLI::App& command, std::optional<std::filesystem::path>& file) {
  command
      .add_option("--plan", file,
                  "Write the memory, time and disk that the run needs, and do not run; the views "
                  "are not read")
      ->type_name("FILE.json")
      ->group(kHelpAllGroup);
}

void write_plan(const std::filesystem::path& file, const options::ReconstructOptions& options,
                const distributed::Communicator& processes) {
  processes.run_collectively([&] { reconstruction::check_options(options); });
  const tilt_series::PlannedSeries series(options.input(), processes);
  processes.run_collectively([&] {
    const plan::RunPlan plan = plan::plan_run(series, options, processes);
    require_few_vertices(plan);
    const std::size_t of_one_thread = memory_of_one_thread(series, options, processes);
    if (!processes.is_root()) return;
    record::PlanRecord record = record_of(options, plan, plan::estimate_run(series, options, plan));
    record.memory_bytes_of_one_thread = static_cast<std::int64_t>(of_one_thread);
    record::write_plan(file, record);
  });
}

void print_estimate(const plan::RunEstimate& estimate, int num_processes) {
  if (estimate.core_seconds) {
    const int threads = base::thread_count() * num_processes;
    print("about {} of processor time, which is {} if nothing else runs on {}\n",
          base::time_text(*estimate.core_seconds),
          base::time_text(*estimate.core_seconds / threads), count_of(threads, "thread"));
  } else {
    print("the processor time of --engine ray and of leaves above 256 pixels is not known\n");
  }
  print("{:.2f} GiB of results, and at most {:.2f} GiB of disk while it runs\n",
        static_cast<double>(estimate.result_bytes) / kGibibyte,
        static_cast<double>(estimate.disk_bytes) / kGibibyte);
}

}  // namespace tomofield::cli
