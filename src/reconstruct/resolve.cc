#include "reconstruct/resolve.h"

#include <algorithm>

#include "fit/stages.h"
#include "option_table/values.h"
#include "output/shared_options.h"

namespace tomofield::reconstruction {
namespace {

fit::FieldOptions field_options(const Options& options) {
  fit::FieldOptions field;
  field.kind = options.field;
  field.tree = options.tree;
  field.leaf_size = options.leaf_size.value_or(fit::usual_leaf_size(field));
  field.depth = fit::usual_depth(field);
  field.leaf_budget = options.leaf_budget;
  field.vertex_spacing = options.vertex_spacing;
  field.rank = options.rank;
  field.with_margin = options.with_margin;
  field.margin_spacing = options.margin_spacing;
  field.activation = options.activation.value_or(field.activation);
  return field;
}

fit::FitOptions fit_options(const Options& options) {
  fit::FitOptions fit;
  fit.epochs = options.epochs.value_or(fit.epochs);
  fit.vertex_epochs = options.vertex_epochs.value_or(fit.vertex_epochs);
  fit.coarse_epochs = options.coarse_epochs.value_or(fit.coarse_epochs);
  fit.coarse_bin = options.coarse_bin;
  fit.subsets = options.subsets;
  fit.engine = options.engine;
  fit.ray_samples = options.ray_samples;
  fit.rays_per_step = options.rays_per_step;
  fit.learning_rate = options.learning_rate.value_or(fit.learning_rate);
  fit.density_variation = options.density_variation.value_or(fit.density_variation);
  fit.factor_variation = options.factor_variation;
  fit.boundary = options.boundary;
  fit.fourier = options.fourier;
  fit.fourier_ring = options.fourier_ring;
  fit.penalty = options.penalty.value_or(fit.penalty);
  fit.fit_view_scale = options.fit_view_scale.value_or(fit.fit_view_scale);
  fit.seed = options.seed;
  fit.hold_out = options.hold_out;
  fit.patience = options.patience;
  return fit;
}

void choose_schedule(Options& options) {
  const fit::FieldOptions field = field_options(options);
  fit::FitOptions fit = fit_options(options);
  // One epoch stands for any number: the usual schedule depends on which stages there are.
  fit.coarse_epochs = options.coarse_epochs.value_or(1);
  const bool has_vertices = fit::begins_with_vertices(field, fit);
  fit.vertex_epochs = options.vertex_epochs.value_or(has_vertices ? 1 : 0);
  const fit::Schedule usual = fit::usual_schedule(field, fit);
  const int epochs = options.epochs.value_or(usual.epochs);
  const int vertex_epochs =
      options.vertex_epochs.value_or(has_vertices ? usual.vertex_epochs_of(epochs) : 0);
  options.epochs = epochs;
  options.vertex_epochs = vertex_epochs;
  if (!options.coarse_epochs)
    options.coarse_epochs = usual.coarse_epochs_of(std::max(epochs, vertex_epochs));
  if (!options.learning_rate) options.learning_rate = usual.learning_rate;
}

void choose_variation(Options& options) {
  if (!options.penalty && options.density_variation) options.penalty = fit::FitOptions{}.penalty;
  if (options.penalty && !options.density_variation)
    options.density_variation = objective::usual_variation(*options.penalty);
}

}  // namespace

Options resolve(const Options& requested) {
  Options options = requested;
  option_table::choose_by_contrast(options);
  options.leaf_size = field_options(options).leaf_size;
  choose_schedule(options);
  choose_variation(options);
  return options;
}

ReconstructOptions run_options(const SeriesFiles& files, const Options& requested) {
  ReconstructOptions run;
  run.files = files;
  run.resolved = resolve(requested);
  run.choose_penalty = !run.resolved.penalty;
  if (run.choose_penalty) {
    run.resolved.penalty = fit::FitOptions{}.penalty;
    choose_variation(run.resolved);
  }
  run.input = output::series_options(files, run.resolved);
  run.specimen = output::specimen_options(run.resolved);
  run.field = field_options(run.resolved);
  run.fit = fit_options(run.resolved);
  run.volume = output::volume_options(run.resolved);
  return run;
}

}  // namespace tomofield::reconstruction
