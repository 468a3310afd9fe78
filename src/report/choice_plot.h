#pragma once

#include <filesystem>

#include "report/curve_plot.h"
#include "tune/trial_settings.h"

namespace tomofield::report {

/// Returns a plot of how much worse than the best each trial predicts the held-out views, over the
/// weight of total variation: a curve for each penalty, and a point for each trial with other
/// corrections of the views. Bars are two standard errors long on either side. There must be a
/// trial.
CurvePlot choice_plot(const tune::TunedFit& tuned);

/// Draws the plot. Replaces `path`. Throws Error if it cannot be written.
void write_choice_plot(const tune::TunedFit& tuned, const std::filesystem::path& path);

}  // namespace tomofield::report
