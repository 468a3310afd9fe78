#include "reconstruct/results.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "base/range.h"
#include "io/json.h"
#include "kernels/lanes.h"
#include "output/held_out_picture.h"
#include "output/metrics.h"
#include "output/volume.h"

namespace tomofield::reconstruction {
namespace {

// The error of the views held out, and a picture of the one nearest to zero tilt.
nlohmann::json score_fit(const fit::Fit& fit, const measurement::PreparedSeries& series,
                         bool stopped_by_them, const std::filesystem::path& picture) {
  const measurement::HeldOutError error = fit.held_out_error();
  const auto nearest = std::ranges::min_element(error.views, {}, [&](int view) {
    return std::abs(series.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  });
  const auto model = error.models[static_cast<std::size_t>(nearest - error.views.begin())];
  const measurement::PredictedView view = fit.predict_held_out(*nearest, model);
  fit.processes().run_collectively([&] {
    if (fit.processes().is_root()) output::write_held_out_picture(picture, view);
  });
  nlohmann::json json =
      measurement::report_held_out(error, series.geometry.tilt_deg, stopped_by_them);
  json["error_by_epoch"] = fit.progress().held_out_error;
  return json;
}

output::VolumeShare volume_share(const fit::Fit& fit, const measurement::PreparedSeries& series) {
  const base::Range slabs = series.rays->held();
  const auto end_row =
      std::min<std::int64_t>(std::int64_t{slabs.end} * kernels::kLanes, series.roi.height());
  const base::Range leaves = fit.own_leaves();
  return {fit.processes(),
          {slabs.begin * kernels::kLanes, static_cast<int>(end_row)},
          fit.field().offset(leaves.begin),
          fit.field().offset(leaves.end)};
}

}  // namespace

output::ModelInfo model_info(const measurement::PreparedSeries& series,
                             const ReconstructOptions& options) {
  output::ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.x_tilt_deg = series.x_tilt_deg;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = options.input.contrast == Contrast::kDark;
  info.options_json = options_json(options).dump();
  return info;
}

void write_results(fit::Fit& fit, const measurement::PreparedSeries& series,
                   const ReconstructOptions& options, const FitOrigin& origin,
                   const OutputPaths& paths, double seconds) {
  nlohmann::json figures = output::figures_json(fit, series, seconds);
  figures["held_out"] = nullptr;
  if (options.fit.hold_out > 0) {
    figures["held_out"] = score_fit(fit, series, options.fit.patience > 0, paths.held_out_picture);
  }
  figures["processes"] = output::processes_json(fit, seconds);
  figures["tuning"] = origin.tuned ? tuning_json(*origin.tuned) : nlohmann::json(nullptr);
  save_fit(paths.model, fit, model_info(series, options), progress_state(fit, origin));
  const output::VolumeShare share = volume_share(fit, series);
  output::Model model{model_info(series, options), fit.take_field()};
  output::write_volume(model, options.volume, paths.volume, share);
  share.processes.run_collectively([&] {
    if (!share.processes.is_root()) return;
    io::write_json(paths.json, {{"tomofield", TOMOFIELD_VERSION},
                                {"options", options_json(options)},
                                {"figures", figures}});
  });
}

}  // namespace tomofield::reconstruction
