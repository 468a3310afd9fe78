#include "reconstruct/fingerprint.h"

#include <fmt/format.h>

namespace tomofield::reconstruction {
namespace {

// Each view's x-axis tilt, 2 × 2 matrix and shift.
nlohmann::json alignment_json(const geometry::RayGeometry& g) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < g.x_tilt_deg.size(); ++v) {
    const geometry::RawFromAligned& m = g.raw_from_aligned[v];
    views.push_back({g.x_tilt_deg[v], m.m11, m.m12, m.m21, m.m22, m.shift_x_px, m.shift_y_px});
  }
  return views;
}

}  // namespace

std::string fingerprint_of(const ReconstructOptions& options,
                           const measurement::Measurement& series,
                           const distributed::Communicator& processes) {
  nlohmann::json json = options_json(options);
  json.erase("input");
  json.erase("volume");
  json["tilt_deg"] = series.geometry.tilt_deg;
  if (series.ray_geometry) json["alignment"] = alignment_json(*series.ray_geometry);
  json["bin_factor"] = series.bin_factor;
  json["unit"] = series.unit;
  json["noise_sigma"] = series.noise_sigma;
  json["rays"] = fmt::format("{:016x}", series.rays->checksum(processes));
  return json.dump();
}

}  // namespace tomofield::reconstruction
