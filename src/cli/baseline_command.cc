#include <fmt/core.h>

#include <memory>
#include <string>

#include "base/parallel.h"
#include "baseline/run_baseline.h"
#include "cli/commands.h"
#include "cli/common_options.h"
#include "cli/input_options.h"
#include "cli/number_checks.h"
#include "cli/pictures.h"
#include "cli/progress_bar.h"
#include "cli/specimen_options.h"
#include "cli/volume_options.h"
#include "reconstruct/options.h"

namespace tomofield::cli {
namespace {

template <typename Method>
struct Arguments {
  baseline::BaselineOptions options;
  Method method;
  std::string view_scale = "auto";
  std::string non_negative = "on";
  bool dry_run = false;
};

template <typename Method>
void run(Arguments<Method>& arguments) {
  baseline::BaselineOptions& options = arguments.options;
  Method& method = arguments.method;
  method.fit_view_scale =
      arguments.view_scale == "on" ||
      (arguments.view_scale == "auto" && options.input.contrast == tilt_series::Contrast::kDark);
  method.non_negative = arguments.non_negative == "on";
  options.method = method;
  reconstruct::require_no_faults(options.specimen.faults());
  baseline::check_outputs(options);
  const tilt_series::TiltSeries series(options.input);
  const baseline::BaselinePlan plan = baseline::plan_baseline(series, options);
  fmt::print("{} views of {} × {} pixels, {:.4g} Å; tomogram {} × {} × {:.0f} voxels\n",
             plan.num_views, plan.geometry.width, plan.geometry.height, plan.pixel_size_A,
             plan.roi.width(), plan.roi.height(), plan.geometry.thickness);
  fmt::print(
      "{} voxels with the margins; {} iterations on {} threads; about {:.2f} GiB of memory\n",
      plan.num_voxels, method.iterations, base::thread_count(),
      static_cast<double>(plan.memory_bytes) / (1 << 30));
  if (arguments.dry_run) return;
  const auto summary = baseline::run_baseline(series, options, make_progress_bar("baseline"));
  fmt::print(
      "mean squared residual {:.4f} of the noise's variance; the objective fell by {:.2g} % in the "
      "last tenth of the iterations\n",
      summary.mean_squared_residual, 100 * summary.last_decrease);
  const baseline::BaselinePaths paths = baseline::baseline_paths(options.output);
  fmt::print("tomogram  {}\nfigures   {}\n", paths.volume.string(), paths.json.string());
  write_pictures(paths.volume, series, paths.picture_prefix);
}

template <typename Method>
void add_method_options(CLI::App& command, Arguments<Method>& arguments) {
  const char* group = "Method";
  command.add_option("--iterations", arguments.method.iterations, "passes over all views")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--non-negative", arguments.non_negative,
                  "keep densities at or above zero (of dark contrast: nothing brighter than the "
                  "empty beam)")
      ->check(CLI::IsMember({"on", "off"}))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--view-scale", arguments.view_scale,
                  "fit a scale and an offset a view; auto: for dark contrast")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--margin-spacing", arguments.options.margin_spacing,
                  "pixels between samples of the margin")
      ->check(number_between(1.0, 64.0))
      ->capture_default_str()
      ->group(group);
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
  add_method_options(command, *arguments);
  add_volume_options(command, arguments->options.volume);
  add_run_options(command, *arguments);
  add_common_options(command);
  command.callback([arguments] { run(*arguments); });
  return arguments;
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

void add_tv(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "tv", "least squares with total variation, by Chambolle and Pock's method");
  const auto arguments = add_method<baseline::TvOptions>(command);
  command
      .add_option("--weight", arguments->method.weight,
                  "of the total variation, in noise units: half the sum of squared residuals over "
                  "the noise's variance, plus this times the sum of the density's gradients")
      ->check(number_above(0))
      ->capture_default_str()
      ->group("Method");
}

}  // namespace

void add_baseline_command(CLI::App& program) {
  CLI::App& command = *program.add_subcommand(
      "baseline", "reconstructions on a voxel grid, to compare with: sirt or tv");
  command.require_subcommand(1);
  add_sirt(command);
  add_tv(command);
}

}  // namespace tomofield::cli
