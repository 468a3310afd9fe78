#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/code_text.h"

namespace tomofield::report {

/// The metrics of one fit of a run, as the JSON file has them. A run has one fit without a name, or
/// one of all data and one of each half.
struct FitMetrics {
  std::string name;  ///< "even half"
  const nlohmann::json& metrics;
};
using AllFits = std::vector<FitMetrics>;

// The plots of a run's report. Each returns an SVG element, or an empty text if there is nothing to
// plot.

/// Plots the residual of the fitted views, and the error of held-out ones, over the epochs.
base::Html loss_plot(const AllFits& fits);
/// Plots how well the trials of different weights predict held-out views.
base::Html trials_plot(const nlohmann::json& metrics);
/// Plots the residual of each view over its tilt, and the error of the held-out ones.
base::Html residual_plot(const AllFits& fits);
/// Plots the fitted scale of each view, and its weight relative to others, over the tilt.
base::Html scale_plot(const AllFits& fits);
/// Plots the fitted offset and the noise of each view over the tilt.
base::Html offset_plot(const AllFits& fits);
/// Plots how far views lie from where the tomogram predicts them, over the tilt.
base::Html displacement_plot(const AllFits& fits);
/// Plots the masked part of each view over the tilt.
base::Html masked_plot(const AllFits& fits);
/// Plots the shell correlation of two halves, in the form of evaluate::fsc_json().
base::Html halves_plot(const nlohmann::json& fsc);
/// Plots how many of these voxels have which density.
base::Html histogram_plot(const std::vector<float>& voxels);

}  // namespace tomofield::report
