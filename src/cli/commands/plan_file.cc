#include "cli/commands/plan_file.h"

#include <fmt/format.h>

#include <string>

#include "base/progress.h"
#include "base/threads/parallel.h"
#include "base/utf8.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "io/json.h"
#include "io/saving/output_files.h"
#include "plan/plan.h"
#include "reconstruct/run_files.h"
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

std::vector<std::string> texts_of(const std::vector<std::filesystem::path>& files) {
  std::vector<std::string> texts;
  for (const auto& file : files) texts.push_back(file.string());
  return texts;
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

void check_answer_file(const std::optional<std::filesystem::path>& file, const char* flag,
                       const options::ReconstructOptions& options) {
  if (!file) return;
  io::check_output_files(
      {*file}, io::input_files(options.files), options.run.overwrite,
      fmt::format("give another name with {}, or --overwrite to replace it", flag));
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
    const plan::RunEstimate estimate = plan::estimate_run(series, options, plan);
    std::vector<std::filesystem::path> inputs = io::input_files(options.files);
    for (const auto& added : io::added_inputs()) inputs.push_back(added);
    const nlohmann::json seconds =
        estimate.core_seconds ? nlohmann::json(*estimate.core_seconds) : nlohmann::json(nullptr);
    const std::string stack =
        std::filesystem::absolute(options.files.stack).lexically_normal().string();
    io::write_json(file,
                   {{"tomofield", TOMOFIELD_VERSION},
                    {"stack", base::utf8_text(stack)},
                    {"views", plan.num_views},
                    {"view_size_px", {plan.view_width, plan.view_height}},
                    {"pixel_size_A", plan.pixel_size_A},
                    {"parameters", plan.num_parameters},
                    {"trials", plan.num_trials},
                    {"open_variation", is_left_to_runs(options, options.open_settings().variation)},
                    {"open_spike_rank", is_left_to_runs(options, options.open_settings().spikes)},
                    {"open_prior", is_left_to_runs(options, options.open_settings().prior)},
                    {"steps", plan.num_steps},
                    {"threads", base::thread_count()},
                    {"memory_bytes", plan.memory_bytes},
                    {"memory_bytes_of_one_thread", of_one_thread},
                    {"core_seconds", seconds},
                    {"sample_steps", estimate.sample_steps},
                    {"result_bytes", estimate.result_bytes},
                    {"disk_bytes", estimate.disk_bytes},
                    {"inputs", texts_of(inputs)},
                    {"results", texts_of(reconstruction::result_files(options))}});
  });
}

void print_estimate(const plan::RunEstimate& estimate, int num_processes) {
  if (estimate.core_seconds) {
    const int threads = base::thread_count() * num_processes;
    print("about {} of processor time, which is {} if nothing else runs on {}\n",
          base::time_text(*estimate.core_seconds),
          base::time_text(*estimate.core_seconds / threads), count_of(threads, "thread"));
  }
  print("{:.2f} GiB of results, and at most {:.2f} GiB of disk while it runs\n",
        static_cast<double>(estimate.result_bytes) / kGibibyte,
        static_cast<double>(estimate.disk_bytes) / kGibibyte);
}

}  // namespace tomofield::cli
