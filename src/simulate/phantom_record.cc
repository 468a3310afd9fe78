#include "simulate/phantom_record.h"

#include <cmath>
#include <numbers>
#include <vector>

#include "base/utf8.h"
#include "io/json.h"
#include "simulate/phantom.h"

namespace tomofield::simulate {
namespace {

using Json = nlohmann::json;

// Adds the options of the microscope that differ from a plain projection.
void add_imaging(const SimulationOptions& options, Json& json) {
  const Imaging& imaging = options.imaging;
  if (imaging.filters()) json["voltage_kV"] = imaging.optics.voltage_kV;
  if (imaging.defocus) {
    json["defocus_um"] = {imaging.defocus->low_um, imaging.defocus->high_um};
    if (imaging.defocus_scatter_um) json["defocus_scatter_um"] = *imaging.defocus_scatter_um;
    json["astigmatism_um"] = imaging.astigmatism_um;
    json["spherical_aberration_mm"] = imaging.optics.spherical_aberration_mm;
    json["amplitude_contrast"] = imaging.optics.amplitude_contrast;
  }
  if (imaging.dose_per_tilt > 0.0) json["dose_per_tilt"] = imaging.dose_per_tilt;
  if (options.noise_blur_px > 0.0) json["noise_blur_px"] = options.noise_blur_px;
}

Json options_json(const SimulationOptions& options) {
  const CellOptions& cell = options.cell;
  Json json{
      {"size_px", cell.size_px},
      {"thickness_px", cell.thickness_px},
      {"extended", cell.is_extended},
      {"seed", cell.seed},
      {"tilts_deg", {options.tilts.first_deg, options.tilts.last_deg, options.tilts.step_deg}},
      {"voxel_size_A", options.voxel_size_A},
      {"contrast", options.contrast == Contrast::kDark ? "dark" : "bright"},
      {"gain_spread", options.gain_spread},
      {"shift_spread_px", options.misalignment.shift_spread_px},
      {"gold_beads", cell.num_beads},
      {"gold_diameter_px", cell.bead_diameter_px},
      {"gold_density", cell.bead_density}};
  const Misalignment& misalignment = options.misalignment;
  if (misalignment.turns_or_scales()) {
    json["rotation_spread_deg"] = misalignment.rotation_spread_deg;
    json["magnification_spread"] = misalignment.magnification_spread;
    json["axis_deg"] = misalignment.axis_deg;
  }
  if (misalignment.tilt_spread_deg > 0.0) json["tilt_spread_deg"] = misalignment.tilt_spread_deg;
  if (misalignment.local_px > 0.0) json["local_px"] = misalignment.local_px;
  if (cell.content == Content::kTextured) json["content"] = "textured";
  if (cell.content == Content::kCryo) json["content"] = "cryo";
  for (const ParticleFile& file : options.particle_files)
    json["particles"].push_back(
        {{"file", base::utf8_text(file.path.string())}, {"count", file.count}});
  if (!options.reference_has_beads) json["reference_has_gold"] = false;
  add_imaging(options, json);
  if (options.dose) {
    json["dose_per_px"] = *options.dose;
    json["absorption_per_A"] = options.absorption_per_A;
  } else if (!options.is_physical()) {
    json["noise"] = options.noise;
  }
  return json;
}

Json body_json(const Ellipsoid& e) {
  return {{"center_px", e.center},
          {"radius_px", e.radius},
          {"q", {{e.q[0], e.q[3], e.q[4]}, {e.q[3], e.q[1], e.q[5]}, {e.q[4], e.q[5], e.q[2]}}},
          {"inner_to_outer_ratio", e.ratio},
          {"wall_density", e.wall_density},
          {"inside_density", e.inside_density}};
}

Json bead_json(const Ellipsoid& e) {
  return {{"center_px", e.center}, {"radius_px", e.radius}, {"density", e.inside_density}};
}

// Returns each blob as X, Y, Z, σ, peak: objects with names would make the record twice as long.
Json blobs_json(const std::vector<Blob>& blobs) {
  Json rows = Json::array();
  for (const Blob& b : blobs)
    rows.push_back({b.center[0], b.center[1], b.center[2], b.sigma, b.peak});
  return rows;
}

// Returns the record of a view. Rotation and magnification appear if the series has any.
Json view_json(const SimulatedView& view, const Misalignment& misalignment) {
  const geometry::RawFromAligned& map = view.raw_from_aligned;
  Json json{{"tilt_deg", view.tilt_deg},
            {"shift_px", {map.shift_x_px, map.shift_y_px}},
            {"gain", view.gain}};
  if (misalignment.tilt_spread_deg > 0.0) json["tilt_error_deg"] = view.tilt_error_deg;
  if (misalignment.turns_or_scales()) {
    json["rotation_deg"] = map.rotation_rad() * 180.0 / std::numbers::pi;
    json["magnification"] = std::sqrt(map.m11 * map.m22 - map.m12 * map.m21);
  }
  if (view.defocus) {
    json["defocus_A"] = {view.defocus->u_A, view.defocus->v_A};
    json["defocus_angle_deg"] = view.defocus->angle_deg;
  }
  if (view.exposure.of_view > 0.0) {
    json["exposure_before"] = view.exposure.before;
    json["exposure"] = view.exposure.of_view;
  }
  if (view.warp) json["local_px"] = view.warp->rows();
  return json;
}

}  // namespace

void write_phantom_record(const std::filesystem::path& file, const SimulationOptions& options,
                          const Phantom& phantom, std::span<const SimulatedView> views,
                          const SimulationSummary& summary) {
  Json json{{"options", options_json(options)},
            {"slab_density", phantom.slab_density},
            {"half_width_px", phantom.half_width_px},
            {"empty_beam", summary.empty_beam}};
  if (summary.sigma) json["noise_sigma"] = *summary.sigma;
  if (summary.truth) {
    json["truth"] = {
        {"min", summary.truth->min}, {"max", summary.truth->max}, {"mean", summary.truth->mean}};
  }
  json["views"] = Json::array();
  for (const SimulatedView& view : views)
    json["views"].push_back(view_json(view, options.misalignment));
  json["ellipsoids"] = Json::array();
  json["gold_beads"] = Json::array();
  const std::size_t num_ellipsoids =
      phantom.bodies.size() - static_cast<std::size_t>(phantom.num_beads);
  for (std::size_t i = 0; i < phantom.bodies.size(); ++i) {
    const Ellipsoid& body = phantom.bodies[i];
    if (i < num_ellipsoids) {
      json["ellipsoids"].push_back(body_json(body));
    } else {
      json["gold_beads"].push_back(bead_json(body));
    }
  }
  // The blobs of a physical specimen would take gigabytes as text.
  if (!phantom.blobs.empty() && !options.is_physical())
    json["blobs_x_y_z_sigma_peak"] = blobs_json(phantom.blobs);
  io::write_json(file, json);
}

}  // namespace tomofield::simulate
