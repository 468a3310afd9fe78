#include "evaluate/volume_score.h"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "evaluate/box.h"
#include "evaluate/reprojection.h"
#include "measurement/held_out.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

void check_volume(const base::Volume& volume, const measurement::Measurement& series,
                  const std::filesystem::path& path) {
  if (series.x_tilt_deg != 0.0) {
    throw Error(fmt::format(
        "the series has an x-axis tilt of {}°, which is not turned back here: leave --xtilt out if "
        "the volume was made without it",
        series.x_tilt_deg));
  }
  if (volume.shape.nx != series.roi.width() || volume.shape.ny != series.roi.height()) {
    throw Error(fmt::format(
        "'{}' has {} × {} × {} voxels, but the region of the views has {} × {} pixels: give the "
        "--bin and --roi that it was made with, and axes in the order xyz",
        path.string(), volume.shape.nx, volume.shape.ny, volume.shape.nz, series.roi.width(),
        series.roi.height()));
  }
  for (const float value : volume.data) {
    if (!std::isfinite(value))
      throw Error(
          fmt::format("'{}' has NaN or infinite voxels, which cannot be projected", path.string()));
  }
}

std::vector<int> scored_views(const geometry::TiltGeometry& geometry, int hold_out) {
  if (hold_out > 0) return measurement::held_out_views(geometry.tilt_deg, hold_out);
  std::vector<int> all(static_cast<std::size_t>(geometry.num_views()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

VolumeScore score_volume(const VolumeScoreOptions& options) {
  const base::Volume volume = evaluate::read_volume(options.volume);
  const tilt_series::TiltSeries series(options.input);
  measurement::SpecimenOptions specimen = options.specimen;
  specimen.thickness = static_cast<double>(volume.shape.nz) * series.bin_factor();
  check_volume(volume, measurement::plan_measurement(series, specimen), options.volume);
  const measurement::Measurement prepared =
      measurement::prepare_measurement(series, specimen, std::filesystem::temp_directory_path());
  std::vector<double> noise_weight;
  for (const double sigma : prepared.noise_sigma) noise_weight.push_back(1.0 / (sigma * sigma));
  VolumeScore score;
  score.unit = prepared.unit;
  score.errors = evaluate::reprojection_errors(
      volume, {prepared.geometry, prepared.roi, !specimen.with_margin}, *prepared.rays,
      scored_views(prepared.geometry, options.hold_out), noise_weight);
  for (const int view : score.errors.views)
    score.tilt_deg.push_back(prepared.geometry.tilt_deg[static_cast<std::size_t>(view)]);
  return score;
}

nlohmann::json volume_score_json(const VolumeScore& score, const VolumeScoreOptions& options) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < score.errors.views.size(); ++v) {
    views.push_back({{"view", score.errors.views[v]},
                     {"tilt_deg", score.tilt_deg[v]},
                     {"error", score.errors.view_error[v]},
                     {"noise_sigma", score.unit / std::sqrt(score.errors.models[v].weight)},
                     {"scale", score.errors.models[v].scale * score.unit},
                     {"offset", score.errors.models[v].offset * score.unit}});
  }
  return {{"series", options.input.stack.string()},
          {"hold_out", options.hold_out},
          {"error", score.errors.total},
          {"views", views}};
}

}  // namespace tomofield::evaluate
