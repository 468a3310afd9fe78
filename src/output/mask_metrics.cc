#include "output/mask_metrics.h"

namespace tomofield::output {

nlohmann::json mask_json(const measurement::Measurement& series) {
  const tilt_series::MaskFigures& masks = series.masks;
  nlohmann::json views = nlohmann::json::array();
  const int num_views = series.geometry.num_views();
  double masked_part = 0;
  for (int v = 0; v < num_views; ++v) {
    const auto view = static_cast<std::size_t>(v);
    masked_part += series.masked_part[view] / num_views;
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[view]},
                     {"beads_found", masks.beads_found[view]},
                     {"beads_masked", masks.beads_masked[view]},
                     {"masked_part", series.masked_part[view]}});
  }
  return {{"beads", masks.num_beads},
          {"bead_diameter_nm", masks.bead_diameter_A / 10},
          {"bad_pixels", masks.num_bad_pixels},
          {"masked_part", masked_part},
          {"views", views}};
}

}  // namespace tomofield::output
