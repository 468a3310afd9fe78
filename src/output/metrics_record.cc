#include "output/metrics_record.h"

#include <fmt/format.h>

#include <cmath>

#include "base/enum_names.h"
#include "base/log.h"

namespace tomofield::output {

using nlohmann::json;

double MaskedViews::mean_part() const {
  double sum = 0;
  for (const double of_view : part) sum += of_view / static_cast<double>(part.size());
  return sum;
}

MaskedViews masked_views(const measurement::Measurement& series) {
  return {.masks = series.masks, .tilt_deg = series.geometry.tilt_deg, .part = series.masked_part};
}

json mask_json(const MaskedViews& masked) {
  const tilt_series::MaskMetrics& masks = masked.masks;
  json views = json::array();
  for (std::size_t view = 0; view < masked.part.size(); ++view)
    views.push_back({{"tilt_deg", masked.tilt_deg[view]},
                     {"beads_found", masks.beads_found[view]},
                     {"beads_masked", masks.beads_masked[view]},
                     {"masked_part", masked.part[view]}});
  return {{"beads", masks.num_beads},
          {"bead_diameter_nm", masks.bead_diameter_A / 10},
          {"bead_masking", base::name_of(masks.bead_masking)},
          {"bad_pixels", masks.num_bad_pixels},
          {"fixed_pattern",
           {{"column_deviation", masks.fixed_pattern.column_deviation},
            {"row_deviation", masks.fixed_pattern.row_deviation},
            {"pixels", masks.fixed_pattern.num_pixels}}},
          {"masked_part", masked.mean_part()},
          {"views", views}};
}

void log_held_out(const measurement::ViewErrors& error, bool stopped_by_them) {
  base::log_info(fmt::format(
      "held out: {} views, error {:.4f}{}", error.views.size(), error.total,
      stopped_by_them ? " (they also chose when to stop, so others are predicted less well)" : ""));
}

json held_out_json(const measurement::ViewErrors& error, const std::vector<double>& tilt_deg,
                   bool stopped_by_them) {
  json views = json::array();
  for (std::size_t i = 0; i < error.views.size(); ++i) {
    const auto view = static_cast<std::size_t>(error.views[i]);
    views.push_back({{"view", view}, {"tilt_deg", tilt_deg[view]}, {"error", error.view_error[i]}});
  }
  return {{"error", error.total}, {"independent", !stopped_by_them}, {"views", views}};
}

json compact_json(const compact::CompressionReport& report, double seconds) {
  return {{"parameters", report.parameters},
          {"bytes", report.bytes},
          {"rms_change_over_deviation", std::sqrt(report.mean_square_change / report.variance)},
          {"decibels", report.decibels},
          {"seconds", seconds}};
}

}  // namespace tomofield::output
