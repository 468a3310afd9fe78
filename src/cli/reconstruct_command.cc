#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "base/enum_names.h"
#include "cli/commands.h"
#include "cli/common_options.h"
#include "cli/enum_option.h"
#include "cli/fit_options.h"
#include "cli/input_options.h"
#include "cli/run_reconstruction.h"
#include "cli/specimen_options.h"
#include "cli/volume_options.h"
#include "fit/stages.h"
#include "io/scratch_memory.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::cli {
namespace {

struct Arguments {
  reconstruction::ReconstructOptions options;
  std::string view_scale = "auto";
  std::string activation = "auto";
  std::optional<int> leaf_size, epochs, vertex_epochs, coarse_epochs;
  std::optional<double> learning_rate;
  std::optional<double> variation;
  std::string penalty = "auto";
  bool dry_run = false;
};

void add_field_options(CLI::App& command, Arguments& arguments) {
  const char* group = "Field";
  fit::FieldOptions& field = arguments.options.field;
  add_enum_option<FieldKind>(command, "--field", field.kind,
                             "vm: vector-matrix factors; grid: plain vertices")
      ->default_str(base::name_of(field.kind))
      ->group(group);
  command
      .add_option("--leaf-size", arguments.leaf_size,
                  "side of a leaf in binned pixels, a multiple of 16; default: 32, 64 of a "
                  "uniform grid")
      ->group(group);
  add_enum_option<TreeKind>(
      command, "--tree", field.tree,
      "uniform: all leaves alike; adaptive: finer where the density varies more")
      ->default_str(base::name_of(field.tree))
      ->group(group);
  command
      .add_option("--leaf-budget", field.leaf_budget,
                  "most leaves of an adaptive tree; 0: as many as it begins with")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--vertex-spacing", field.vertex_spacing,
                  "pixels between vertices, in leaves of --leaf-size")
      ->capture_default_str()
      ->group(group);
  command.add_option("--rank", field.rank, "components of each mode (vm)")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--activation", arguments.activation,
                  "softplus, or identity for densities of either sign; auto: identity for dark "
                  "contrast, whose zero is uncertain")
      ->check(CLI::IsMember({"auto", "softplus", "identity"}))
      ->capture_default_str()
      ->group(group);
}

void add_fit_options(CLI::App& command, Arguments& arguments) {
  const char* group = "Fit";
  fit::FitOptions& fit = arguments.options.fit;
  command
      .add_option(
          "--epochs", arguments.epochs,
          "passes over all views at full resolution; default: 10, 30 of factors that do not "
          "begin with vertices, 5 of vertices 2 pixels apart or further (4 of an adaptive tree)")
      ->group(group);
  command
      .add_option(
          "--vertex-epochs", arguments.vertex_epochs,
          "passes at full resolution before them: in these and the coarse ones plain vertices are "
          "fitted, which are factorised then; 0: factors from the start; default: as many as "
          "--epochs, at most 10, where vertices take no more memory than factors")
      ->group(group);
  command
      .add_option("--coarse-epochs", arguments.coarse_epochs,
                  "passes before all of these over binned views; 0: none; default: 80, or as many "
                  "times fewer as --epochs are than usual")
      ->group(group);
  command
      .add_option("--coarse-bin", fit.coarse_bin,
                  "pixels of the coarsest on each axis, at most: a power of two that divides a "
                  "sixteenth of a leaf's side; passes of half as many follow, down to 2")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--subsets", fit.subsets,
                  "steps a pass, each with an interleaved subset of the views")
      ->capture_default_str()
      ->group(group);
  add_enum_option<Engine>(
      command, "--engine", fit.engine,
      "slab: fast, one tilt axis; ray: any view geometry, without resampling the views")
      ->default_str(base::name_of(fit.engine))
      ->group(group);
  command
      .add_option("--ray-samples", fit.ray_samples,
                  "ray engine: samples along a leaf's diagonal; 0: one a pixel")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--rays-per-step", fit.rays_per_step,
                  "ray engine: about as many rays a step; 0: those of all views over --subsets")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--learning-rate", arguments.learning_rate,
                  "of the first step; it falls exponentially; default: 0.05, 0.035 of a grid; "
                  "vertices that are to be factorised take 0.7 of it, factors made of them 0.3")
      ->group(group);
  command
      .add_option("--tv", arguments.variation,
                  "weight of the density's total variation, in noise units; default: 14, 5 if "
                  "smooth")
      ->group(group);
  command
      .add_option("--tv-factors", fit.factor_variation, "weight of the factors' total variation")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--tv-penalty", arguments.penalty,
                  "concave (keeps edges sharp) or smooth; auto: what predicts held-out views "
                  "better in two short trials, concave if --tv is given")
      ->check(CLI::IsMember({"auto", "concave", "smooth"}))
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--bcc", fit.boundary,
                  "weight of what neighbouring leaves disagree by on their faces")
      ->capture_default_str()
      ->group(group);
  command
      .add_option("--ifp", fit.fourier,
                  "weight of the isotropic Fourier prior, against streaks along X and Y")
      ->capture_default_str()
      ->group(group);
  add_enum_option<RingReference>(
      command, "--ifp-ring", fit.fourier_ring,
      "what the Fourier axes are compared with: a ring's mean or its max")
      ->default_str(base::name_of(fit.fourier_ring))
      ->group(group);
  add_shared_fit_options(
      command, {arguments.options.field.margin_spacing, fit.hold_out, arguments.view_scale});
  command
      .add_flag("--tune", arguments.options.tune,
                "choose --tv-penalty, --tv, --rank and --epochs by how well short trials predict "
                "every 8th view, then fit all views with them (but those of --hold-out, which no "
                "trial sees)")
      ->group(group);
  command
      .add_option("--early-stop", fit.patience,
                  "epochs without a better held-out error after which the fit stops; 0: never")
      ->capture_default_str()
      ->group(group);
  add_seed(command, fit.seed, group);
}

void set_leaves(Arguments& arguments) {
  fit::FieldOptions& field = arguments.options.field;
  field.leaf_size = arguments.leaf_size.value_or(fit::usual_leaf_size(field));
  field.depth = fit::usual_depth(field);
}

void set_schedule(Arguments& arguments) {
  fit::FitOptions& fit = arguments.options.fit;
  // Any but 0: there is such a stage.
  fit.coarse_epochs = arguments.coarse_epochs.value_or(1);
  const bool has_vertices = fit::begins_with_vertices(arguments.options.field, fit);
  fit.vertex_epochs = arguments.vertex_epochs.value_or(has_vertices ? 1 : 0);
  const fit::Schedule usual = fit::usual_schedule(arguments.options.field, fit);
  fit.epochs = arguments.epochs.value_or(usual.epochs);
  if (!arguments.vertex_epochs && has_vertices)
    fit.vertex_epochs = usual.vertex_epochs_of(fit.epochs);
  if (!arguments.coarse_epochs)
    fit.coarse_epochs = usual.coarse_epochs_of(std::max(fit.epochs, fit.vertex_epochs));
  fit.learning_rate = arguments.learning_rate.value_or(usual.learning_rate);
}

void run(Arguments& arguments, const distributed::Communicator& processes) {
  reconstruction::ReconstructOptions& options = arguments.options;
  const bool is_dark = options.input.contrast == Contrast::kDark;
  options.fit.fit_view_scale = is_on(arguments.view_scale, is_dark);
  options.field.with_margin = options.specimen.with_margin;
  set_leaves(arguments);
  set_schedule(arguments);
  options.choose_penalty = arguments.penalty == "auto" && !arguments.variation;
  if (arguments.penalty != "auto")
    options.fit.penalty = *base::enum_named<Penalty>(arguments.penalty);
  options.fit.density_variation =
      arguments.variation.value_or(objective::usual_variation(options.fit.penalty));
  if (arguments.activation != "auto")
    options.field.activation = *base::enum_named<Activation>(arguments.activation);
  else if (is_dark)
    options.field.activation = Activation::kIdentity;
  options.input.resample = options.fit.engine == Engine::kSlab;
  processes.run_collectively([&] { reconstruction::check_options(options); });
  options.input.scratch_dir = io::scratch_directory(options.output);
  options.input.keep_views = !arguments.dry_run;
  const tilt_series::TiltSeries series(options.input, processes);
  run_reconstruction(series, options, arguments.dry_run, processes);
}

}  // namespace

void add_reconstruct_command(CLI::App& program, const distributed::Communicator& processes) {
  CLI::App& command = *program.add_subcommand(
      "reconstruct", "tilt series in, clean tomogram and compact model out");
  auto arguments = std::make_shared<Arguments>();
  add_input_options(command, arguments->options.input);
  add_specimen_options(command, arguments->options.specimen);
  add_field_options(command, *arguments);
  add_fit_options(command, *arguments);
  add_volume_options(command, arguments->options.volume);
  add_run_options(command, arguments->options, arguments->dry_run);
  add_common_options(command);
  command.callback([arguments, &processes] { run(*arguments, processes); });
}

}  // namespace tomofield::cli
