#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/threads/parallel.h"
#include "baseline/method_options.h"
#include "baseline/run_baseline.h"
#include "baseline/tune.h"
#include "cli/commands/commands.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/commands/tensorf_command.h"
#include "cli/options/common_options.h"
#include "cli/options/fit_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "cli/terminal/console.h"
#include "cli/terminal/progress_bar.h"
#include "distributed/communicator.h"
#include "output/output_paths.h"
#include "tilt_series/series_plan.h"

namespace tomofield::cli {
namespace {

using option_table::Group;

struct BaselineArguments {
  option_table::Choices choices;
  baseline::BaselineOptions options;  // with what `choices` has not: the method and its options
  DryRun dry_run;
  std::optional<std::filesystem::path> trace;
};

Sizes sizes_of(const baseline::BaselinePlan& plan, VolumeAxes axes) {
  return {plan.num_views,
          plan.geometry.width,
          plan.geometry.height,
          plan.pixel_size_A,
          plan.roi,
          plan.geometry.thickness,
          axes};
}

// Prints the plan of a baseline, before other output, in a file too. Returns the volume's sizes.
Sizes print_plan(const baseline::BaselinePlan& plan, const baseline::BaselineOptions& options,
                 const baseline::MethodFacts& method) {
  const Sizes sizes = sizes_of(plan, options.shared.volume.axes);
  print_sizes(sizes);
  print("{} voxels with the margins, {} parameters; {} on {}; about {:.2f} GiB of memory\n",
        plan.num_voxels, plan.num_parameters, count_of(method.iterations, "iteration"),
        count_of(base::thread_count(), "thread"),
        static_cast<double>(plan.memory_bytes) / (1 << 30));
  if (options.shared.fit.tune)
    print("short trials first, that choose settings by held-out views\n");
  flush_output();
  return sizes;
}

void print_summary(const baseline::BaselineSummary& summary) {
  print("mean squared residual {:.4f} of the noise's variance", summary.mean_squared_residual);
  if (summary.last_decrease) {
    print("; the objective fell by {:.2g} % in the last tenth of the iterations",
          100 * *summary.last_decrease);
  }
  print("\n");
}

// Checks the views and prints what a baseline would do.
void rehearse(const baseline::BaselineOptions& options, const baseline::MethodFacts& method,
              const DryRun& dry_run) {
  const tilt_series::MeasuredSeries series(options.input());
  const Sizes sizes = print_plan(baseline::plan_baseline(series, options), options, method);
  if (!dry_run.grid) return;
  const output::OutputPaths paths = output::output_paths(options.shared.run.output);
  std::vector<std::filesystem::path> results = paths.pictures();
  results.insert(results.end(), {paths.volume, paths.json});
  if (options.shared.volume.zarr) results.push_back(output::zarr_path(paths.volume));
  write_grid(*dry_run.grid, sizes, std::move(results));
}

// Runs a baseline whose options have been checked.
void run_method(const baseline::BaselineOptions& options, const baseline::MethodFacts& method,
                const output::OutputPaths& paths) {
  const tilt_series::TiltSeries series(options.input());
  print_plan(baseline::plan_baseline(series, options), options, method);
  print_summary(baseline::run_baseline(series, options,
                                       {make_progress_bar("tune"), make_progress_bar("baseline")}));
  print("tomogram  {}\nmetrics   {}\n", paths.volume.string(), paths.json.string());
  print_pictures(paths.pictures());
}

void run(const CLI::App& command, BaselineArguments& arguments) {
  open_project(command, arguments.choices);
  baseline::BaselineOptions& options = arguments.options;
  options.files = arguments.choices.files;
  options.shared = arguments.choices.options;
  const RunOptions& files = options.shared.run;
  if (files.output.empty()) throw Error("-o '' names no file: name the tomogram");
  baseline::settle(options);
  const baseline::MethodFacts method = baseline::facts_of(options.method);
  const output::OutputPaths paths = output::output_paths(files.output);
  const auto check_files_beside = [&] {
    check_extra_files({{arguments.trace, "--trace"}, {arguments.dry_run.grid, "--grid"}},
                      {paths.volume, paths.json}, options.files, files);
  };
  if (arguments.dry_run.is_wanted) {
    baseline::check_options(options);
    check_files_beside();
    return rehearse(options, method, arguments.dry_run);
  }
  const std::vector<io::OutputLock> locks = baseline::claim_outputs(options);
  check_files_beside();
  run_traced(arguments.trace, distributed::Communicator::alone(),
             [&] { run_method(options, method, paths); });
}

// Registers an option of a method.
void add_method_option(CLI::App& command, const baseline::MethodOption& option,
                       baseline::BaselineOptions& options) {
  const auto check = [option, &options](const std::string& text) -> std::string {
    baseline::BaselineOptions scratch = options;
    const std::string wanted = baseline::set_from_text(option, text, scratch);
    return wanted.empty() ? "" : fmt::format("must be {}, not '{}'", wanted, text);
  };
  command
      .add_option_function<std::string>(
          std::string(option.flag),
          [option, &options](const std::string& text) {
            baseline::set_from_text(option, text, options);
          },
          std::string(option.help))
      ->check(CLI::Validator(check, ""))
      ->type_name(baseline::label_of(option))
      ->default_str(baseline::default_text(option, options))
      ->group(std::string(option.group));
}

void add_tune(CLI::App& command, BaselineArguments& arguments) {
  command
      .add_flag("--tune", arguments.choices.options.fit.tune,
                "Choose the weight, or what else regularises, by short trials that predict every "
                "8th view, then reconstruct from all views. No trial sees those of --hold-out")
      ->group("Fit");
}

void add_run_options(CLI::App& command, BaselineArguments& arguments) {
  for (const std::string_view key : baseline::kRunKeys) add_row(command, key, arguments.choices);
  command
      .add_flag("--dry-run", arguments.dry_run.is_wanted,
                "Check everything and print the plan and the memory it needs")
      ->group(std::string(title_of(Group::kRun)));
  add_grid_option(command, arguments.dry_run.grid);
}

// Registers a method.
void add_method(CLI::App& baseline, const char* name, const char* help) {
  CLI::App& command = *baseline.add_subcommand(name, help);
  const auto arguments = std::make_shared<BaselineArguments>();
  arguments->options.method = *baseline::method_named(name);
  add_input_options(command, arguments->choices);
  add_groups(command, arguments->choices, {Group::kTransfer, Group::kSpecimen});
  for (const baseline::MethodOption& option : baseline::options_of(arguments->options.method))
    add_method_option(command, option, arguments->options);
  add_shared_fit_options(command, arguments->choices);
  if (baseline::is_tunable(arguments->options.method)) add_tune(command, *arguments);
  add_groups(command, arguments->choices, {Group::kVolume});
  add_run_options(command, *arguments);
  add_common_options(command);
  add_trace_option(command, arguments->trace);
  add_help_all(command);
  command.callback([&command, arguments] { run_stoppable([&] { run(command, *arguments); }); });
}

}  // namespace

void add_baseline_command(CLI::App& program) {
  CLI::App& command =
      *program.add_subcommand("baseline", "Reconstruct by another method, to compare with");
  command.require_subcommand(1);
  add_method(command, "wbp", "Weighted (filtered) back-projection: a ramp filter with a roll-off");
  add_method(command, "sirt",
             "Simultaneous iterative reconstruction, stopped before it fits the noise");
  add_method(command, "sart-tv",
             "Ordered subsets of views, with steps down the total variation between passes");
  add_method(command, "tv", "Least squares with total variation, by Chambolle and Pock's method");
  add_tensorf(command);
  add_method(command, "ingp",
             "A multi-resolution hash grid and a small network, as in Instant-NGP");
  add_method(command, "fourier-net",
             "A network of plane waves, which learns the noise of each view");
}

}  // namespace tomofield::cli
