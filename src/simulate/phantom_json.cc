#include "simulate/phantom_json.h"

namespace tomofield::simulate {
namespace {

using Json = nlohmann::json;

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
      {"shift_spread_px", options.shift_spread_px},
      {"gold_beads", cell.num_beads},
      {"gold_diameter_px", cell.bead_diameter_px},
      {"gold_density", cell.bead_density}};
  if (options.dose) {
    json["dose_per_px"] = *options.dose;
    json["absorption_per_A"] = options.absorption_per_A;
  } else {
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

}  // namespace

nlohmann::json phantom_json(const SimulationOptions& options, const Phantom& phantom,
                            std::span<const SimulatedView> views,
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
  for (const SimulatedView& view : views) {
    json["views"].push_back({{"tilt_deg", view.tilt_deg},
                             {"shift_px", {view.shift_x_px, view.shift_y_px}},
                             {"gain", view.gain}});
  }
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
  return json;
}

}  // namespace tomofield::simulate
