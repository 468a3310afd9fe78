#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/code_text.h"

namespace tomofield::report {

/// A named line through points (x, y), in order. With errors, one of each point, the points have
/// marks and bars of y ± error.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
  std::vector<double> errors = {};
};

/// A place on an axis that has a label.
struct Tick {
  double at = 0;
  std::string label;
};

/// The axes of a plot. A range without extent is taken from the curves. Ticks that are not given
/// stand at round numbers. The picture is `height_px` high if its legend needs no more.
struct PlotAxes {
  std::string x_title, y_title;
  std::pair<double, double> x_range{0, 0}, y_range{0, 0};
  std::vector<Tick> x_ticks = {}, y_ticks = {};
  int height_px = 360;
};

/// Curves over common axes.
struct CurvePlot {
  PlotAxes axes;
  std::vector<Curve> curves;
};

/// Draws the curves over common axes, with a grid line at every tick and a legend. Returns an SVG
/// element that needs nothing else. Points that are not finite interrupt a curve; points beyond the
/// ends of the y axis are drawn at the ends. At most twelve curves have a colour of their own. A
/// long name takes several lines of the legend, and the picture is as high as its legend needs.
base::Html curve_plot_svg(const PlotAxes& axes, const std::vector<Curve>& curves);
/// Draws plots, of which there is one at least, one below the other as a PNG that is 900 pixels
/// wide, with the letters of report/canvas.h. Replaces `path`. Throws Error if it cannot be
/// written.
void write_curve_plots(const std::vector<CurvePlot>& plots, const std::filesystem::path& path);
/// Does the same with one plot.
void write_curve_plot(const PlotAxes& axes, const std::vector<Curve>& curves,
                      const std::filesystem::path& path);

/// Returns the range of all finite values y of curves, with 8 % of it as room on either side, but
/// at least `least_room`. Without such values the range is not finite.
std::pair<double, double> range_with_room(const std::vector<Curve>& curves, double least_room);

/// Returns ticks for an axis of decimal logarithms: 1, 2 and 5 times each power of ten in a range
/// of values above 0, or the powers of ten alone if the range has many.
std::vector<Tick> log_ticks(double low, double high);

/// Returns about five round numbers (1, 2 or 5 times a power of ten apart) within a range.
std::vector<double> round_ticks(double low, double high);

}  // namespace tomofield::report
