#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "baseline/run_baseline.h"
#include "baseline/tune.h"
#include "cli/commands/commands.h"
#include "cli/commands/run_reconstruction.h"
#include "cli/commands/tensorf_command.h"
#include "cli/options/common_options.h"
#include "cli/options/fit_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/number_checks.h"
#include "cli/options/table_options.h"
#include "cli/options/trace_option.h"
#include "cli/terminal/console.h"
#include "cli/terminal/progress_bar.h"
#include "distributed/communicator.h"
#include "io/saving/output_set.h"
#include "output/output_paths.h"
#include "report/pictures.h"
#include "tilt_series/series_plan.h"

namespace tomofield::cli {
namespace {

using option_table::Group;
using Origins = std::vector<Setting>;

template <typename Method>
struct BaselineArguments {
  option_table::Choices choices;
  Method method;
  microscope::CtfCorrection ctf_correction = microscope::CtfCorrection::kFlip;
  std::optional<bool> non_negative;
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
  const tilt_series::MeasuredSeries series(
      tilt_series::series_options(options.files, options.shared));
  const Sizes sizes = print_plan(baseline::plan_baseline(series, options), options, method);
  if (dry_run.grid) write_grid(*dry_run.grid, sizes);
}

// Runs a baseline whose options have been checked.
void run_method(const baseline::BaselineOptions& options, const baseline::MethodFacts& method,
                const output::OutputPaths& paths) {
  const tilt_series::TiltSeries series(tilt_series::series_options(options.files, options.shared));
  print_plan(baseline::plan_baseline(series, options), options, method);
  io::OutputSet results;
  const baseline::BaselineSummary summary = baseline::run_baseline(
      series, options, {make_progress_bar("tune"), make_progress_bar("baseline")});
  report::write_run_pictures(results.location_of(paths.volume), series, summary.bead_masking,
                             paths);
  results.commit();
  print_summary(summary);
  print("tomogram  {}\nmetrics   {}\n", paths.volume.string(), paths.json.string());
  print_pictures(paths.pictures());
}

template <typename Method>
void run(BaselineArguments<Method>& arguments, const Origins& origins) {
  option_table::note_settings(origins, arguments.choices);
  const Options& shared = arguments.choices.options;
  Method& method = arguments.method;
  if constexpr (requires { method.non_negative; })
    method.non_negative = arguments.non_negative.value_or(shared.views.contrast != Contrast::kDark);
  const baseline::BaselineOptions options{arguments.choices.files, shared, method,
                                          arguments.ctf_correction};
  const output::OutputPaths paths = output::output_paths(shared.run.output);
  const auto check_trace = [&] {
    check_trace_file(arguments.trace, {paths.volume, paths.json}, options.files,
                     shared.run.overwrite);
  };
  if (arguments.dry_run.is_wanted) {
    baseline::check_options(options);
    check_trace();
    return rehearse(options, method.facts(), arguments.dry_run);
  }
  const std::vector<io::OutputLock> locks = baseline::claim_outputs(options);
  check_trace();
  run_traced(arguments.trace, distributed::Communicator::alone(),
             [&] { run_method(options, method.facts(), paths); });
}

// Registers the options of every method.
template <typename Method>
void add_fit_options(CLI::App& command, BaselineArguments<Method>& arguments) {
  add_shared_fit_options(command, arguments.choices);
  if constexpr (baseline::Tunable<Method>) {
    command
        .add_flag("--tune", arguments.choices.options.fit.tune,
                  "Choose the weight, or what else regularises, by short trials that predict every "
                  "8th view, then reconstruct from all views. No trial sees those of --hold-out")
        ->group("Fit");
  }
}

// Registers the options of methods that iterate.
template <typename Method>
void add_iteration_options(CLI::App& command, BaselineArguments<Method>& arguments) {
  command.add_option("--iterations", arguments.method.iterations, "Passes over all views")
      ->check(number_above(0))
      ->capture_default_str()
      ->group("Method");
  add_non_negative(command, arguments.non_negative);
}

template <typename Method>
void add_run_options(CLI::App& command, BaselineArguments<Method>& arguments) {
  for (const char* key : {"running.output", "running.overwrite"})
    add_row(command, key, arguments.choices);
  command
      .add_flag("--dry-run", arguments.dry_run.is_wanted,
                "Check everything and print the plan and the memory it needs")
      ->group(std::string(title_of(Group::kRun)));
  add_grid_option(command, arguments.dry_run.grid);
}

template <typename Method>
std::shared_ptr<BaselineArguments<Method>> add_method(CLI::App& command, const Origins& origins) {
  auto arguments = std::make_shared<BaselineArguments<Method>>();
  add_input_options(command, arguments->choices);
  add_groups(command, arguments->choices, {Group::kTransfer, Group::kSpecimen});
  add_enum_option<microscope::CtfCorrection>(
      command, "--ctf-correction", arguments->ctf_correction,
      "What takes the contrast transfer of --ctf or --defocus back before the reconstruction, each "
      "place of a view with its own defocus: flip its phases, multiply by it, or Wiener's filter")
      ->default_str(base::name_of(arguments->ctf_correction))
      ->group(std::string(title_of(Group::kTransfer)));
  if constexpr (requires { arguments->method.iterations; })
    add_iteration_options(command, *arguments);
  add_fit_options(command, *arguments);
  add_groups(command, arguments->choices, {Group::kVolume});
  add_run_options(command, *arguments);
  add_common_options(command);
  add_trace_option(command, arguments->trace);
  add_help_all(command);
  command.callback([arguments, &origins] { run(*arguments, origins); });
  return arguments;
}

void add_wbp(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "wbp", "Weighted (filtered) back-projection: a ramp filter with a roll-off");
  const auto arguments = add_method<baseline::WbpOptions>(command, origins);
  baseline::RampFilterOptions& filter = arguments->method.filter;
  const char* group = "Method";
  add_enum_option<baseline::RampWindow>(command, "--window", filter.window,
                                        "Window that multiplies the ramp; ramp: none")
      ->default_str(base::name_of(filter.window))
      ->group(group);
  command
      .add_option("--cutoff", filter.cutoff,
                  "Frequency up to which the ramp rises, in cycles a pixel. 0.5: all frequencies")
      ->check(number_between(0.01, 0.5))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--falloff", filter.falloff,
                  "Sigma of the Gaussian by which it falls beyond, in cycles a pixel")
      ->check(number_between(0.001, 0.5))
      ->capture_default_str()
      ->group(group);
}

void add_sirt(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "sirt", "Simultaneous iterative reconstruction, stopped before it fits the noise");
  const auto arguments = add_method<baseline::SirtOptions>(command, origins);
  command
      .add_option("--relaxation", arguments->method.relaxation, "Length of a step, between 0 and 2")
      ->check(number_between(0.01, 1.99))
      ->capture_default_str()
      ->group("Method");
}

void add_sart_tv(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "sart-tv", "Ordered subsets of views, with steps down the total variation between passes");
  const auto arguments = add_method<baseline::SartTvOptions>(command, origins);
  baseline::SartTvOptions& method = arguments->method;
  const char* group = "Method";
  command.add_option("--subsets", method.subsets, "Interleaved subsets of the views in a pass")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--relaxation", method.relaxation,
                  "Length of a subset's step in the first pass, between 0 and 2; it decays")
      ->check(number_between(0.01, 1.99))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--tv-steps", method.tv_steps,
                  "Number of steps down the total variation after each pass")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--weight", method.weight,
                  "Length of these steps together, in units of the change that the pass made")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
}

void add_tv(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "tv", "Least squares with total variation, by Chambolle and Pock's method");
  const auto arguments = add_method<baseline::TvOptions>(command, origins);
  baseline::TvOptions& method = arguments->method;
  const char* group = "Method";
  command
      .add_option("--weight", method.weight,
                  "Weight of the total variation, in noise units: the objective is half the sum of "
                  "squared residuals over the noise's variance, plus this times the sum of the "
                  "density's gradients")
      ->check(number_above(0))
      ->default_str("3; 8 if concave")
      ->group(group);
  add_enum_option<Penalty>(
      command, "--penalty", method.penalty,
      "Kind of total variation: smooth is the usual one, concave spares edges by reweighting")
      ->default_str("smooth; with --tune the one that predicts held-out views better")
      ->group(group);
}

// Registers the options of methods that fit a network.
void add_network_options(CLI::App& command, baseline::NetworkOptions& method) {
  const char* group = "Method";
  constexpr int kMaxLayers = 16, kMaxWidth = 1024;
  command
      .add_option("--hidden-layers", method.hidden_layers,
                  "Layers of neurons between the features of a position and its density")
      ->check(number_between(1, kMaxLayers))
      ->capture_default_str()
      ->group(group);
  command.add_option("--width", method.width, "Neurons of a hidden layer")
      ->check(number_between(1, kMaxWidth))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--learning-rate", method.learning_rate,
                  "Learning rate of the first step; it decays to a tenth")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  add_seed(command, method.seed, group);
}

void add_ingp(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "ingp", "A multi-resolution hash grid and a small network, as in Instant-NGP");
  const auto arguments = add_method<baseline::IngpOptions>(command, origins);
  add_network_options(command, arguments->method);
  baseline::HashGridOptions& grid = arguments->method.grid;
  const char* group = "Method";
  command.add_option("--levels", grid.levels, "Number of grids, from coarse to fine")
      ->check(number_between(1, 32))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--coarsest", grid.coarsest,
                  "Distance between vertices of the coarsest level, in binned pixels")
      ->check(number_between(0.25, 1024))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--finest", grid.finest,
                  "Distance between vertices of the finest level, in binned pixels")
      ->check(number_between(0.25, 1024))
      ->capture_default_str()
      ->group(group);
  command
      .add_option(
          "--table-bits", grid.table_bits,
          "Binary logarithm of the most vertices that a level stores. Where it has more, they "
          "share entries by a hash")
      ->check(number_between(4, 28))
      ->capture_default_str()
      ->group(group);
}

void add_fourier_net(CLI::App& baseline, const Origins& origins) {
  CLI::App& command = *baseline.add_subcommand(
      "fourier-net", "A network of plane waves, which learns the noise of each view");
  const auto arguments = add_method<baseline::FourierNetOptions>(command, origins);
  add_network_options(command, arguments->method);
  command
      .add_option("--features", arguments->method.features,
                  "Plane waves of random direction: the features of a position")
      ->check(number_between(1, 4096))
      ->capture_default_str()
      ->group("Method");
  command
      .add_option("--shortest", arguments->method.shortest,
                  "Shortest wavelength of the plane waves, in binned pixels")
      ->check(number_between(1, 1024))
      ->capture_default_str()
      ->group("Method");
}

}  // namespace

void add_baseline_command(CLI::App& program, const Origins& origins) {
  CLI::App& command =
      *program.add_subcommand("baseline", "Reconstruct by another method, to compare with");
  command.require_subcommand(1);
  add_wbp(command, origins);
  add_sirt(command, origins);
  add_sart_tv(command, origins);
  add_tv(command, origins);
  add_tensorf(command, origins);
  add_ingp(command, origins);
  add_fourier_net(command, origins);
}

}  // namespace tomofield::cli
