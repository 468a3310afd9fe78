#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "report/canvas.h"

namespace tomofield::report {

/// A place on an axis that has a label.
struct Tick {
  double at = 0.0;
  std::string label;
};

/// One line of a plot; NaN leaves a gap.
struct PlotLine {
  std::string name;
  Colour colour{};
  std::vector<double> y;  ///< at each x of the plot
};

/// Lines over a common x axis. The ticks of y go through the plot as grid lines.
struct LinePlot {
  std::string x_label, y_label;
  std::vector<double> x;  ///< ascending
  double x_low = 0.0, x_high = 1.0, y_low = 0.0, y_high = 1.0;
  std::vector<Tick> x_ticks, y_ticks;
  std::vector<PlotLine> lines;
};

/// Draws a plot of 720 × 480 pixels with the names of the lines in their colours;
/// values beyond the ends of the y axis are drawn there. Letters as in report/text.h.
/// Replaces `path`. Throws Error.
void write_line_plot(const LinePlot& plot, const std::filesystem::path& path);

}  // namespace tomofield::report
