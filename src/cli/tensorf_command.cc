#include "cli/tensorf_command.h"

#include <memory>
#include <string>

#include "baseline/neural/tensorf.h"
#include "cli/common_options.h"
#include "cli/fit_options.h"
#include "cli/input_options.h"
#include "cli/number_checks.h"
#include "cli/run_reconstruction.h"
#include "cli/specimen_options.h"
#include "cli/volume_options.h"
#include "io/scratch_memory.h"

namespace tomofield::cli {
namespace {

struct Arguments {
  reconstruction::ReconstructOptions options = baseline::tensorf_options();
  std::string view_scale = "auto";
  std::string non_negative = "auto";
  bool dry_run = false;
};

void add_method_options(CLI::App& command, Arguments& arguments) {
  const char* group = "Method";
  constexpr double kMost = 1e9;
  fit::FitOptions& fit = arguments.options.fit;
  command.add_option("--rank", arguments.options.field.rank, "components of each mode")
      ->check(number_between(1, 256))
      ->capture_default_str()
      ->group(group);
  command.add_option("--epochs", fit.epochs, "passes over all views at full resolution")
      ->check(number_between(1, kMost))
      ->capture_default_str()
      ->group(group);
  command
      .add_option(
          "--coarse-epochs", fit.coarse_epochs,
          "passes before them, with an eighth, a quarter and half the vertices on each axis "
          "in turn; 0: none")
      ->check(number_between(0, kMost))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--tv", fit.density_variation,
                  "weight of the density's total variation, in noise units; 0: none")
      ->check(number_between(0, kMost))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--ifp", fit.fourier,
                  "weight of the isotropic Fourier prior, against streaks along X and Y; 0: none")
      ->check(number_between(0, kMost))
      ->capture_default_str()
      ->group(group);
  add_non_negative(command, arguments.non_negative);
  command
      .add_option("--learning-rate", fit.learning_rate, "of the first step; it falls exponentially")
      ->check(number_above(0))
      ->capture_default_str()
      ->group(group);
  add_seed(command, fit.seed, group);
}

void run(Arguments& arguments) {
  reconstruction::ReconstructOptions& options = arguments.options;
  const bool is_dark = options.input.contrast == Contrast::kDark;
  options.fit.fit_view_scale = is_on(arguments.view_scale, is_dark);
  options.field.activation =
      is_on(arguments.non_negative, !is_dark) ? Activation::kSoftplus : Activation::kIdentity;
  options.field.with_margin = options.specimen.with_margin;
  reconstruction::check_options(options);
  options.input.scratch_dir = io::scratch_directory(options.output);
  options.input.keep_views = !arguments.dry_run;
  const tilt_series::TiltSeries series(options.input);
  baseline::cover_with_one_node(plan_measurement(series, options.specimen).roi, options);
  run_reconstruction(series, options, arguments.dry_run);
}

}  // namespace

void add_tensorf(CLI::App& baseline) {
  CLI::App& command = *baseline.add_subcommand(
      "tensorf", "one factorised tensor for all, coarse to fine, as in TensoRF");
  const auto arguments = std::make_shared<Arguments>();
  reconstruction::ReconstructOptions& options = arguments->options;
  add_input_options(command, options.input);
  add_specimen_options(command, options.specimen);
  add_method_options(command, *arguments);
  add_shared_fit_options(
      command, {options.field.margin_spacing, options.fit.hold_out, arguments->view_scale});
  add_volume_options(command, options.volume);
  add_run_options(command, arguments->options, arguments->dry_run);
  add_common_options(command);
  command.callback([arguments] { run(*arguments); });
}

}  // namespace tomofield::cli
