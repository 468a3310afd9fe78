#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "measurement/prepare.h"
#include "measurement/view_residuals.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::evaluate {

/// A volume of any program and the series that its projections are compared with.
struct VolumeScoreOptions {
  std::filesystem::path volume;  ///< MRC, axes x, y, z, one voxel a binned pixel
  tilt_series::TiltSeriesOptions input;
  measurement::SpecimenOptions specimen;  ///< `thickness` is the volume's own
  int hold_out = 0;  ///< score every Nth view, as reconstruct holds them out; 0: all
};

/// The reprojection error of a volume.
struct VolumeScore {
  measurement::ViewErrors errors;
  std::vector<double> tilt_deg;  ///< one a scored view
  double unit = 1.0;             ///< data units that predictions and offsets are divided by
};

/// Computes the reprojection error of a volume (evaluate/reprojection.h). Throws Error for a volume
/// that is not of the region of interest, and for a series that read_tilt_series() refuses.
VolumeScore score_volume(const VolumeScoreOptions& options);

/// Returns the score as JSON. Noise, scales and offsets are in the units of the stack.
nlohmann::json volume_score_json(const VolumeScore& score, const VolumeScoreOptions& options);

}  // namespace tomofield::evaluate
