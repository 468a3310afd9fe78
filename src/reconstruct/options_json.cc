#include "reconstruct/options_json.h"

#include <nlohmann/json.hpp>
#include <string>

#include "base/enum_names.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {
namespace {

using nlohmann::json;

template <typename T>
json or_null(const std::optional<T>& value) {
  return value ? json(*value) : json(nullptr);
}

json or_null(const std::optional<std::filesystem::path>& path) {
  return path ? json(path->string()) : json(nullptr);
}

}  // namespace

json input_json(const tilt_series::TiltSeriesOptions& o) {
  return {{"stack", o.stack.string()},
          {"tlt", or_null(o.tlt)},
          {"xf", or_null(o.xf)},
          {"xtilt", or_null(o.xtilt)},
          {"aln", or_null(o.aln)},
          {"mdoc", or_null(o.mdoc)},
          {"exclude", o.exclude},
          {"bin", o.bin},
          {"angpix", or_null(o.angpix)},
          {"pixel_size_A", or_null(o.pixel_size_A)},
          {"contrast", base::name_of(o.contrast)},
          {"log", o.take_log},
          {"bead_diameter_nm", or_null(o.bead_diameter_nm)},
          {"fiducials", or_null(o.fiducials)},
          {"mask", or_null(o.mask)}};
}

json specimen_json(const measurement::SpecimenOptions& o) {
  json roi = nullptr;
  if (o.roi) roi = {o.roi->x0, o.roi->y0, o.roi->x1, o.roi->y1};
  return {{"thickness", o.thickness},
          {"roi", roi},
          {"hand", o.hand},
          {"axis_x", or_null(o.axis_x)},
          {"axis_z", or_null(o.axis_z)}};
}

namespace {

json field_json(const fit::FieldOptions& o) {
  return {{"kind", base::name_of(o.kind)},
          {"leaf_size", o.leaf_size},
          {"tree", base::name_of(o.tree)},
          {"depth", o.depth},
          {"leaf_budget", o.leaf_budget},
          {"vertex_spacing", o.vertex_spacing},
          {"rank", o.rank},
          {"with_margin", o.with_margin},
          {"margin_spacing", o.margin_spacing},
          {"margin_rank", o.margin_rank},
          {"activation", base::name_of(o.activation)},
          {"sharpness", o.sharpness},
          {"initial_scale", o.initial_scale}};
}

json fit_json(const fit::FitOptions& o) {
  return {{"epochs", o.epochs},
          {"vertex_epochs", o.vertex_epochs},
          {"coarse_epochs", o.coarse_epochs},
          {"coarse_bin", o.coarse_bin},
          {"subsets", o.subsets},
          {"engine", base::name_of(o.engine)},
          {"ray_samples", o.ray_samples},
          {"rays_per_step", o.rays_per_step},
          {"learning_rate", o.learning_rate},
          {"final_rate", o.final_rate},
          {"coarse_final_rate", o.coarse_final_rate},
          {"refined_rate", o.refined_rate},
          {"vertex_rate", o.vertex_rate},
          {"factorised_rate", o.factorised_rate},
          {"density_variation", o.density_variation},
          {"factor_variation", o.factor_variation},
          {"boundary", o.boundary},
          {"fourier", o.fourier},
          {"fourier_ring", base::name_of(o.fourier_ring)},
          {"penalty", base::name_of(o.penalty)},
          {"concavity", o.concavity},
          {"gradient_floor", o.gradient_floor},
          {"hold_out", o.hold_out},
          {"patience", o.patience},
          {"fit_view_scale", o.fit_view_scale},
          {"seed", o.seed}};
}

json volume_json(const output::VolumeOptions& o) {
  return {
      {"mode", static_cast<int>(o.mode)}, {"axes", base::name_of(o.axes)}, {"invert", o.invert}};
}

}  // namespace

json options_json(const ReconstructOptions& options) {
  return {{"input", input_json(options.input)},       {"specimen", specimen_json(options.specimen)},
          {"field", field_json(options.field)},       {"fit", fit_json(options.fit)},
          {"choose_penalty", options.choose_penalty}, {"tune", options.tune},
          {"volume", volume_json(options.volume)}};
}

}  // namespace tomofield::reconstruction
