#include "report/curve_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "report/html.h"

namespace tomofield::report {
namespace {

// The drawing area in a picture of kWidth × kHeight; the legend is at its right.
constexpr double kWidth = 900, kHeight = 360;
constexpr double kLeft = 70, kRight = 660, kTop = 15, kBottom = 305;

// Told apart by people who see colours differently (Okabe and Ito 2008).
constexpr std::array<std::string_view, 8> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                      "#e69f00", "#56b4e9", "#000000", "#b0a000"};

using Range = std::pair<double, double>;

Range range_of(const std::vector<Curve>& curves, double std::pair<double, double>::*coordinate) {
  Range range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const Curve& curve : curves) {
    for (const auto& point : curve.points) {
      if (!std::isfinite(point.*coordinate)) continue;
      range = {std::min(range.first, point.*coordinate), std::max(range.second, point.*coordinate)};
    }
  }
  if (!(range.first < range.second)) range = {range.first - 1, range.first + 1};
  return std::isfinite(range.first) ? range : Range{0, 1};
}

class Plot {
 public:
  Plot(const PlotAxes& axes, const std::vector<Curve>& curves)
      : x_(axes.x_range.first < axes.x_range.second
               ? axes.x_range
               : range_of(curves, &std::pair<double, double>::first)),
        y_(axes.y_range.first < axes.y_range.second
               ? axes.y_range
               : range_of(curves, &std::pair<double, double>::second)) {}

  std::string grid() const {
    std::string svg;
    for (const double tick : round_ticks(x_.first, x_.second)) {
      svg += line(at_x(tick), kTop, at_x(tick), kBottom);
      svg += text(at_x(tick), kBottom + 18, "middle", fmt::format("{:g}", tick));
    }
    for (const double tick : round_ticks(y_.first, y_.second)) {
      svg += line(kLeft, at_y(tick), kRight, at_y(tick));
      svg += text(kLeft - 6, at_y(tick) + 4, "end", fmt::format("{:g}", tick));
    }
    return svg;
  }

  // Pieces between points that are not finite.
  std::string path(const Curve& curve, std::string_view colour) const {
    std::string d;
    bool goes_on = false;
    for (const auto& [x, y] : curve.points) {
      if (!std::isfinite(x) || !std::isfinite(y)) {
        goes_on = false;
        continue;
      }
      d += fmt::format("{}{:.1f} {:.1f} ", goes_on ? "L" : "M", at_x(x),
                       std::clamp(at_y(y), kTop, kBottom));
      goes_on = true;
    }
    return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>\n", d,
                       colour);
  }

  static std::string text(double x, double y, std::string_view anchor, std::string_view words) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y,
                       anchor, html_text(words));
  }

 private:
  double at_x(double x) const {
    return kLeft + (x - x_.first) / (x_.second - x_.first) * (kRight - kLeft);
  }
  double at_y(double y) const {
    return kBottom - (y - y_.first) / (y_.second - y_.first) * (kBottom - kTop);
  }
  static std::string line(double x0, double y0, double x1, double y1) {
    return fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#ddd\"/>\n", x0, y0,
        x1, y1);
  }

  Range x_, y_;
};

std::string legend(const std::vector<Curve>& curves) {
  std::string svg;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const double y = kTop + 12 + 20 * static_cast<double>(i);
    svg += fmt::format(
        "<line x1=\"{0}\" y1=\"{1}\" x2=\"{2}\" y2=\"{1}\" stroke=\"{3}\" stroke-width=\"3\"/>\n",
        kRight + 15, y - 4, kRight + 40, kColours[i % kColours.size()]);
    svg += Plot::text(kRight + 48, y, "start", curves[i].name);
  }
  return svg;
}

}  // namespace

std::vector<double> round_ticks(double low, double high) {
  const double rough = (high - low) / 5;
  const double decade = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * decade;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= rough) {
      step = factor * decade;
      break;
    }
  }
  std::vector<double> ticks;
  const double slack = 1e-9 * step;  // of ticks at the very ends
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack; ++k)
    ticks.push_back(k * step);
  return ticks;
}

std::string curve_plot_svg(const PlotAxes& axes, const std::vector<Curve>& curves) {
  const Plot plot(axes, curves);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "height=\"{1}\" font-family=\"system-ui, sans-serif\" font-size=\"13\">\n",
      kWidth, kHeight);
  svg += plot.grid();
  for (std::size_t i = 0; i < curves.size(); ++i)
    svg += plot.path(curves[i], kColours[i % kColours.size()]);
  svg += legend(curves);
  svg += Plot::text((kLeft + kRight) / 2, kHeight - 10, "middle", axes.x_title);
  svg += fmt::format(
      "<text transform=\"translate(16 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
      (kTop + kBottom) / 2, html_text(axes.y_title));
  return svg + "</svg>\n";
}

}  // namespace tomofield::report
