#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluate/resolution/fsc.h"
#include "record/run_record.h"
#include "tune/trial_settings.h"

namespace tomofield::report {

/// One fit of a run. A run has one fit without a name, or one of all data and one of each half.
struct NamedFit {
  std::string name;  ///< "even half"
  const record::FitRecord& fit;
  const record::FitMetrics& metrics() const { return fit.metrics; }
};
using AllFits = std::vector<NamedFit>;

// The plots of a run's report. Each returns an SVG element, or an empty text if there is nothing to
// plot.

/// Plots the residual of the fitted views, and the error of held-out ones, over the epochs.
std::string loss_plot(const AllFits& fits);
/// Plots how well the trials of different weights predict held-out views.
std::string trials_plot(const std::optional<tune::TunedFit>& tuned);
/// Plots the residual of each view over its tilt, and the error of the held-out ones.
std::string residual_plot(const AllFits& fits);
/// Plots the fitted scale of each view, and its weight relative to others, over the tilt.
std::string scale_plot(const AllFits& fits);
/// Plots the fitted offset and the noise of each view over the tilt.
std::string offset_plot(const AllFits& fits);
/// Plots how far views lie from where the tomogram predicts them, over the tilt.
std::string displacement_plot(const AllFits& fits);
/// Plots the masked part of each view over the tilt.
std::string masked_plot(const AllFits& fits);
/// Plots the shell correlation of two halves.
std::string halves_plot(const evaluate::Fsc& fsc);
/// Plots how many of these voxels have which density.
std::string histogram_plot(const std::vector<float>& voxels);

}  // namespace tomofield::report
