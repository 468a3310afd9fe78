#include "reconstruct/resolve.h"

#include <algorithm>

#include "fit/stages.h"

namespace tomofield::reconstruction {
namespace {

tilt_series::TiltSeriesOptions input_of(const SeriesFiles& files, const Options& o) {
  return {.stack = files.stack,
          .images = {},
          .tlt = files.tlt,
          .xf = files.xf,
          .xtilt = files.xtilt,
          .aln = files.aln,
          .mdoc = files.mdoc,
          .exclude = o.exclude,
          .bin = o.bin,
          .angpix = o.angpix,
          .pixel_size_A = o.pixel_size_A,
          .contrast = o.contrast,
          .take_log = o.take_log,
          .resample = o.engine == Engine::kSlab,
          .mask = files.mask,
          .fiducials = files.fiducials,
          .bead_diameter_nm = o.bead_diameter_nm};
}

measurement::SpecimenOptions specimen_of(const Options& o) {
  measurement::SpecimenOptions specimen{.thickness = o.thickness,
                                        .roi = {},
                                        .hand = o.hand,
                                        .axis_x = o.axis_x,
                                        .axis_z = o.axis_z,
                                        .with_margin = o.with_margin};
  if (o.roi) specimen.roi = geometry::Roi{o.roi->x0, o.roi->y0, o.roi->x1, o.roi->y1};
  return specimen;
}

fit::FieldOptions field_of(const Options& o) {
  fit::FieldOptions field;
  field.kind = o.field;
  field.tree = o.tree;
  field.leaf_size = o.leaf_size.value_or(fit::usual_leaf_size(field));
  field.depth = fit::usual_depth(field);
  field.leaf_budget = o.leaf_budget;
  field.vertex_spacing = o.vertex_spacing;
  field.rank = o.rank;
  field.with_margin = o.with_margin;
  field.margin_spacing = o.margin_spacing;
  field.activation = o.activation.value_or(o.contrast == Contrast::kDark ? Activation::kIdentity
                                                                         : Activation::kSoftplus);
  return field;
}

fit::FitOptions fit_of(const Options& o, const fit::FieldOptions& field) {
  fit::FitOptions fit;
  fit.coarse_bin = o.coarse_bin;
  fit.subsets = o.subsets;
  fit.engine = o.engine;
  fit.ray_samples = o.ray_samples;
  fit.rays_per_step = o.rays_per_step;
  fit.factor_variation = o.factor_variation;
  fit.boundary = o.boundary;
  fit.fourier = o.fourier;
  fit.fourier_ring = o.fourier_ring;
  fit.penalty = o.penalty.value_or(fit.penalty);
  fit.density_variation = o.density_variation.value_or(objective::usual_variation(fit.penalty));
  fit.fit_view_scale = o.fit_view_scale.value_or(o.contrast == Contrast::kDark);
  fit.seed = o.seed;
  fit.hold_out = o.hold_out;
  fit.patience = o.patience;
  // Any but 0: there is such a stage.
  fit.coarse_epochs = o.coarse_epochs.value_or(1);
  const bool has_vertices = fit::begins_with_vertices(field, fit);
  fit.vertex_epochs = o.vertex_epochs.value_or(has_vertices ? 1 : 0);
  const fit::Schedule usual = fit::usual_schedule(field, fit);
  fit.epochs = o.epochs.value_or(usual.epochs);
  if (!o.vertex_epochs && has_vertices) fit.vertex_epochs = usual.vertex_epochs_of(fit.epochs);
  if (!o.coarse_epochs)
    fit.coarse_epochs = usual.coarse_epochs_of(std::max(fit.epochs, fit.vertex_epochs));
  fit.learning_rate = o.learning_rate.value_or(usual.learning_rate);
  return fit;
}

output::VolumeOptions volume_of(const Options& o) {
  output::VolumeOptions volume;
  volume.mode = o.voxel_type == VoxelType::kFloat32   ? io::MrcMode::kFloat32
                : o.voxel_type == VoxelType::kFloat16 ? io::MrcMode::kFloat16
                                                      : io::MrcMode::kInt16;
  volume.axes = o.axes;
  volume.invert = o.invert;
  return volume;
}

}  // namespace

Options resolve(const Options& requested) {
  const ReconstructOptions run = run_options({}, requested);
  Options options = requested;
  options.leaf_size = run.field.leaf_size;
  options.activation = run.field.activation;
  options.epochs = run.fit.epochs;
  options.vertex_epochs = run.fit.vertex_epochs;
  options.coarse_epochs = run.fit.coarse_epochs;
  options.learning_rate = run.fit.learning_rate;
  options.fit_view_scale = run.fit.fit_view_scale;
  if (run.choose_penalty) return options;
  options.penalty = run.fit.penalty;
  options.density_variation = run.fit.density_variation;
  return options;
}

ReconstructOptions run_options(const SeriesFiles& files, const Options& o) {
  ReconstructOptions options;
  options.input = input_of(files, o);
  options.specimen = specimen_of(o);
  options.field = field_of(o);
  options.fit = fit_of(o, options.field);
  options.choose_penalty = !o.penalty && !o.density_variation;
  options.tune = o.tune;
  options.volume = volume_of(o);
  options.output = o.output;
  options.overwrite = o.overwrite;
  options.resume = o.resume;
  options.checkpoint_minutes = o.checkpoint_minutes;
  return options;
}

}  // namespace tomofield::reconstruction
