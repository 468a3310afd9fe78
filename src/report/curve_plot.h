#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tomofield::report {

/// A named line through points (x, y), in order.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
};

/// A place on an axis that has a label.
struct Tick {
  double at = 0;
  std::string label;
};

/// What a plot shows; a range without extent is taken from the curves, and ticks that are not
/// given stand at round numbers.
struct PlotAxes {
  std::string x_title, y_title;
  std::pair<double, double> x_range{0, 0}, y_range{0, 0};
  std::vector<Tick> x_ticks = {}, y_ticks = {};
};

/// The curves over common axes, with a grid line at every tick and a legend. Points that are not
/// finite interrupt a curve; those beyond the ends of the y axis are drawn there. At most twelve
/// curves have colours of their own. The legend has long names on several lines, and a picture
/// whose legend is long is as high as it takes. As an SVG element that needs nothing else:
std::string curve_plot_svg(const PlotAxes& axes, const std::vector<Curve>& curves);
/// The same as a PNG of 900 × 360 pixels (or higher), with letters as in report/text.h. Replaces
/// `path`. Throws Error.
void write_curve_plot(const PlotAxes& axes, const std::vector<Curve>& curves,
                      const std::filesystem::path& path);

/// Round numbers (1, 2 or 5 times a power of ten apart) within a range, about five.
std::vector<double> round_ticks(double low, double high);

}  // namespace tomofield::report
