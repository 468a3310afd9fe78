#pragma once

#include <string>
#include <utility>
#include <vector>

namespace tomofield::report {

/// A named line through points (x, y), in order.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
};

/// What a plot shows; a range without extent is taken from the curves.
struct PlotAxes {
  std::string x_title, y_title;
  std::pair<double, double> x_range{0, 0}, y_range{0, 0};
};

/// The curves over common axes with ticks at round numbers and a legend, as an SVG element that
/// needs nothing else. Points that are not finite interrupt a curve. At most eight curves
/// have colours of their own.
std::string curve_plot_svg(const PlotAxes& axes, const std::vector<Curve>& curves);

/// Round numbers (1, 2 or 5 times a power of ten apart) within a range, about five.
std::vector<double> round_ticks(double low, double high);

}  // namespace tomofield::report
