#include "reconstruct/results.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/range.h"
#include "base/trace.h"
#include "io/json.h"
#include "output/metrics.h"
#include "output/shared_options.h"
#include "output/volume.h"
#include "report/pictures.h"

namespace tomofield::reconstruction {
namespace {

// Draws the held-out view nearest to zero tilt.
void write_picture(const fit::Fit& fit, const measurement::Measurement& series,
                   const measurement::ViewErrors& error, const std::filesystem::path& picture) {
  const auto nearest = std::ranges::min_element(error.views, {}, [&](int view) {
    return std::abs(series.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  });
  const auto model = error.models[static_cast<std::size_t>(nearest - error.views.begin())];
  const measurement::PredictedView view = fit.predict_held_out(*nearest, model);
  fit.processes().run_collectively([&] {
    if (fit.processes().is_root()) report::write_held_out_picture(view, picture);
  });
}

// Returns the errors of the held-out views. Draws one of these views if the run writes files.
nlohmann::json score_fit(const fit::Fit& fit, const measurement::Measurement& series,
                         const ReconstructOptions& options) {
  const base::TraceSpan span("score held-out views");
  const measurement::ViewErrors error = fit.held_out_error();
  if (!options.resolved.output.empty())
    write_picture(fit, series, error, output_paths(options.resolved.output).held_out_picture);
  nlohmann::json json =
      measurement::report_held_out(error, series.geometry.tilt_deg, options.fit.patience > 0);
  json["error_by_epoch"] = fit.progress().held_out_error;
  return json;
}

// Returns the rows and the parameters that this process contributes to the volume.
output::VolumeShare volume_share(const fit::Fit& fit, const measurement::Measurement& series) {
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

output::ModelInfo model_info(const measurement::Measurement& series,
                             const ReconstructOptions& options) {
  output::ModelInfo info = output::model_info(series, options.input.contrast);
  info.options_json = options_json(options).dump();
  return info;
}

Results finish(fit::Fit& fit, const measurement::Measurement& series,
               const ReconstructOptions& options, const FitOrigin& origin, double seconds) {
  nlohmann::json metrics = output::metrics_json(fit, series, seconds);
  metrics["held_out"] = nullptr;
  if (options.fit.hold_out > 0) metrics["held_out"] = score_fit(fit, series, options);
  metrics["processes"] = output::processes_json(fit, seconds);
  metrics["tuning"] = origin.tuned ? tuning_json(*origin.tuned) : nlohmann::json(nullptr);
  const output::ModelInfo info = model_info(series, options);
  const output::VolumeShare share = volume_share(fit, series);
  const bool writes_files = !options.resolved.output.empty();
  const OutputPaths paths = output_paths(options.resolved.output);
  if (writes_files) save_fit(paths.model, fit, info, progress_state(fit, origin));
  Results results{.model = {info, fit.take_field()},
                  .metrics = {{"tomofield", TOMOFIELD_VERSION},
                              {"options", options_json(options)},
                              {"metrics", std::move(metrics)}}};
  if (!writes_files) return results;
  output::write_volume(results.model, options.volume, paths.volume, share);
  share.processes.run_collectively([&] {
    if (share.processes.is_root()) io::write_json(paths.json, results.metrics);
  });
  return results;
}

}  // namespace tomofield::reconstruction
