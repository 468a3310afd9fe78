#include <fmt/core.h>

#include <cstdio>
#include <memory>
#include <string>

#include "base/check.h"
#include "base/parallel.h"
#include "baseline/run_baseline.h"
#include "baseline/tune.h"
#include "cli/commands.h"
#include "cli/common_options.h"
#include "cli/enum_option.h"
#include "cli/fit_options.h"
#include "cli/input_options.h"
#include "cli/number_checks.h"
#include "cli/pictures.h"
#include "cli/progress_bar.h"
#include "cli/specimen_options.h"
#include "cli/tensorf_command.h"
#include "cli/volume_options.h"
#include "fit/options.h"

namespace tomofield::cli {
namespace {

template <typename Method>
struct Arguments {
  baseline::BaselineOptions options;
  Method method;
  std::string view_scale = "auto";
  std::string non_negative = "auto";
  bool dry_run = false;
};

void print_plan(const baseline::BaselinePlan& plan, const baseline::MethodFacts& method,
                VolumeAxes axes) {
  print_sizes({plan.num_views, plan.geometry.width, plan.geometry.height, plan.pixel_size_A,
               plan.roi, plan.geometry.thickness, axes});
  fmt::print(
      "{} voxels with the margins, {} parameters; {} iteration{} on {} threads; about {:.2f} GiB "
      "of memory\n",
      plan.num_voxels, plan.num_parameters, method.iterations, method.iterations == 1 ? "" : "s",
      base::thread_count(), static_cast<double>(plan.memory_bytes) / (1 << 30));
}

void print_summary(const baseline::BaselineSummary& summary) {
  fmt::print("mean squared residual {:.4f} of the noise's variance", summary.mean_squared_residual);
  if (summary.last_decrease) {
    fmt::print("; the objective fell by {:.2g} % in the last tenth of the iterations",
               100 * *summary.last_decrease);
  }
  fmt::print("\n");
}

template <typename Method>
void run(Arguments<Method>& arguments) {
  baseline::BaselineOptions& options = arguments.options;
  Method& method = arguments.method;
  const bool is_dark = options.input.contrast == Contrast::kDark;
  options.fit_view_scale = is_on(arguments.view_scale, is_dark);
  if constexpr (requires { method.non_negative; })
    method.non_negative = is_on(arguments.non_negative, !is_dark);
  options.method = method;
  base::require_no_faults(options.specimen.faults());
  baseline::check_outputs(options);
  const tilt_series::TiltSeries series(options.input);
  print_plan(baseline::plan_baseline(series, options), method.facts(), options.volume.axes);
  if (options.tune) fmt::print("short trials first, that choose settings by held-out views\n");
  std::fflush(stdout);  // before what comes of the run, in a file too
  if (arguments.dry_run) return;
  print_summary(baseline::run_baseline(series, options,
                                       {make_progress_bar("tune"), make_progress_bar("baseline")}));
  const baseline::BaselinePaths paths = baseline::baseline_paths(options.output);
  fmt::print("tomogram  {}\nfigures   {}\n", paths.volume.string(), paths.json.string());
  write_pictures(paths.volume, series, paths.picture_prefix);
}

// Of every method.
template <typename Method>
void add_fit_options(CLI::App& command, Arguments<Method>& arguments) {
  baseline::BaselineOptions& options = arguments.options;
  add_shared_fit_options(command, {options.margin_spacing, options.hold_out, arguments.view_scale});
  if constexpr (baseline::Tunable<Method>) {
    command
        .add_flag("--tune", options.tune,
                  "choose the weight, or what else regularises, by how well short trials predict "
                  "every 8th view, then reconstruct from all views with it (but those of "
                  "--hold-out, which no trial sees)")
        ->group("Fit");
  }
}

// Of those that iterate.
template <typename Method>
void add_iteration_options(CLI::App& command, Arguments<Method>& arguments) {
  command.add_option("--iterations", arguments.method.iterations, "passes over all views")
      ->check(number_above(0))
      ->capture_default_str()
      ->group("Method");
  add_non_negative(command, arguments.non_negative);
}

template <typename Method>
void add_run_options(CLI::App& command, Arguments<Method>& arguments) {
  const char* group = "Running";
  command
      .add_option("-o,--output", arguments.options.output,
                  "the tomogram; figures (.json) and pictures go beside it")
      ->required()
      ->group(group);
  command.add_flag("--overwrite", arguments.options.overwrite, "replace existing results")
      ->group(group);
  command
      .add_flag("--dry-run", arguments.dry_run,
                "check everything, print what would be done and the memory it needs")
      ->group(group);
}

template <typename Method>
std::shared_ptr<Arguments<Method>> add_method(CLI::App& command) {
  auto arguments = std::make_shared<Arguments<Method>>();
  add_input_options(command, arguments->options.input);
  add_specimen_options(command, arguments->options.specimen);
  if constexpr (requires { arguments->method.iterations; })
    add_iteration_options(command, *arguments);
  add_fit_options(command, *arguments);
  add_volume_options(command, arguments->options.volume);
  add_run_options(command, *arguments);
  add_common_options(command);
  command.callback([arguments] { run(*arguments); });
  return arguments;
}

void add_wbp(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "wbp", "weighted (filtered) back-projection: a ramp with a roll-off");
  const auto arguments = add_method<baseline::WbpOptions>(command);
  baseline::RampFilterOptions& filter = arguments->method.filter;
  const char* group = "Method";
  command.add_option("--window", filter.window, "factor of the ramp: ramp (none), cosine or hann")
      ->check(CLI::IsMember({"ramp", "cosine", "hann"}))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--cutoff", filter.cutoff,
                  "frequency in cycles a pixel up to which the ramp rises; 0.5: all")
      ->check(number_between(0.01, 0.5))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--falloff", filter.falloff,
                  "sigma of the Gaussian, in cycles a pixel, by which it falls beyond")
      ->check(number_between(0.001, 0.5))
      ->capture_default_str()
      ->group(group);
}

void add_sirt(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "sirt", "simultaneous iterative reconstruction, stopped before it fits the noise");
  const auto arguments = add_method<baseline::SirtOptions>(command);
  command
      .add_option("--relaxation", arguments->method.relaxation, "length of a step, between 0 and 2")
      ->check(number_between(0.01, 1.99))
      ->capture_default_str()
      ->group("Method");
}

void add_sart_tv(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "sart-tv", "ordered subsets of views, with steps down the total variation between passes");
  const auto arguments = add_method<baseline::SartTvOptions>(command);
  baseline::SartTvOptions& method = arguments->method;
  const char* group = "Method";
  command.add_option("--subsets", method.subsets, "interleaved subsets of the views in a pass")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--relaxation", method.relaxation,
                  "length of a subset's step in the first pass, between 0 and 2; it falls")
      ->check(number_between(0.01, 1.99))
      ->capture_default_str()
      ->group(group);
  command.add_option("--tv-steps", method.tv_steps, "down the total variation after each pass")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--weight", method.weight,
                  "length of these steps altogether, over that of the change which the pass made")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
}

void add_tv(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "tv", "least squares with total variation, by Chambolle and Pock's method");
  const auto arguments = add_method<baseline::TvOptions>(command);
  baseline::TvOptions& method = arguments->method;
  const char* group = "Method";
  command
      .add_option("--weight", method.weight,
                  "of the total variation, in noise units: half the sum of squared residuals over "
                  "the noise's variance, plus this times the sum of the density's gradients; "
                  "default: 3, 8 if concave")
      ->check(number_above(0))
      ->group(group);
  add_enum_option<Penalty>(
      command, "--penalty", method.penalty,
      "smooth: total variation; concave: spares edges, reweighted; default: smooth, and "
      "with --tune the one that predicts held-out views better")
      ->group(group);
}

// Of the methods that fit a network.
void add_network_options(CLI::App& command, baseline::NetworkOptions& method) {
  const char* group = "Method";
  constexpr int kMostLayers = 16, kWidest = 1024;
  command
      .add_option("--hidden-layers", method.hidden_layers,
                  "layers of neurons between what is given for a position and its density")
      ->check(number_between(1, kMostLayers))
      ->capture_default_str()
      ->group(group);
  command.add_option("--width", method.width, "neurons of a hidden layer")
      ->check(number_between(1, kWidest))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--learning-rate", method.learning_rate, "of the first step; it falls to a tenth")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  add_seed(command, method.seed, group);
}

void add_ingp(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "ingp", "a multi-resolution hash grid and a small network, as in Instant-NGP");
  const auto arguments = add_method<baseline::IngpOptions>(command);
  add_network_options(command, arguments->method);
  baseline::HashGridOptions& grid = arguments->method.grid;
  const char* group = "Method";
  command.add_option("--levels", grid.levels, "grids, from coarse to fine")
      ->check(number_between(1, 32))
      ->capture_default_str()
      ->group(group);
  command.add_option("--coarsest", grid.coarsest, "pixels between vertices of the coarsest level")
      ->check(number_between(0.25, 1024))
      ->capture_default_str()
      ->group(group);
  command.add_option("--finest", grid.finest, "pixels between vertices of the finest level")
      ->check(number_between(0.25, 1024))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--table-bits", grid.table_bits,
                  "log2 of the most vertices that a level stores; where it has more, they share "
                  "entries by a hash")
      ->check(number_between(4, 28))
      ->capture_default_str()
      ->group(group);
}

void add_implicit(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "implicit", "a network of coordinates, which learns the noise of each view");
  const auto arguments = add_method<baseline::ImplicitOptions>(command);
  add_network_options(command, arguments->method);
  command
      .add_option("--features", arguments->method.features,
                  "plane waves of random direction that the network is given for a position")
      ->check(number_between(1, 4096))
      ->capture_default_str()
      ->group("Method");
  command
      .add_option("--shortest", arguments->method.shortest,
                  "shortest wavelength of them, in pixels")
      ->check(number_between(1, 1024))
      ->capture_default_str()
      ->group("Method");
}

}  // namespace

void add_baseline_command(CLI::App& program) {
  CLI::App& command =
      *program.add_subcommand("baseline", "reconstructions by other methods, to compare with");
  command.require_subcommand(1);
  add_wbp(command);
  add_sirt(command);
  add_sart_tv(command);
  add_tv(command);
  add_tensorf(command);
  add_ingp(command);
  add_implicit(command);
}

}  // namespace tomofield::cli
