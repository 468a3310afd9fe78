#pragma once

#include <filesystem>
#include <vector>

#include "reconstruct/trial_settings.h"
#include "report/curve_plot.h"

namespace tomofield::reconstruction {

/// A plot of how much worse than the best each trial predicts the held-out views, over the weight
/// of total variation: a curve for each penalty, and a point for each trial with other corrections
/// of the views. Bars are two standard errors long on either side.
struct ChoicePlot {
  report::PlotAxes axes;
  std::vector<report::Curve> curves;
};
/// Returns the plot of these trials, of which there must be one.
ChoicePlot choice_plot(const TunedFit& tuned);

/// Draws the plot. Replaces `path`. Throws Error if it cannot be written.
void write_choice_plot(const TunedFit& tuned, const std::filesystem::path& path);

}  // namespace tomofield::reconstruction
