#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "measurement/prepare.h"
#include "measurement/view_errors.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::evaluate {

/// A volume of any program, and the views that it shall explain.
struct VolumeScoreOptions {
  std::filesystem::path volume;  ///< MRC, axes x, y, z, one voxel a binned pixel
  tilt_series::TiltSeriesOptions input;
  measurement::SpecimenOptions specimen;  ///< `thickness` is the volume's own
  int hold_out = 0;  ///< score the views that reconstruct keeps from the fit; 0: all
};

struct VolumeScore {
  measurement::ViewErrors errors;
  std::vector<double> tilt_deg;  ///< of each scored view
  double unit = 1.0;             ///< data units that predictions and offsets are divided by
};

/// Reprojection error of a volume (evaluate/reprojection.h). Throws Error for a
/// volume that is not of the region of interest, and for what read_tilt_series() refuses.
VolumeScore score_volume(const VolumeScoreOptions& options);

/// Noise, scales and offsets are in the units of the stack.
nlohmann::json volume_score_json(const VolumeScore& score, const VolumeScoreOptions& options);

}  // namespace tomofield::evaluate
