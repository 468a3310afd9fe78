#include "report/curve_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "report/plot_surface.h"

namespace tomofield::report {
namespace {

// The drawing area of a picture of kWidth pixels. The legend is at its right.
constexpr int kWidth = 900;
constexpr double kLeft = 70, kRight = 660, kTop = 30, kBelow = 55;
constexpr double kLine = 20;            // distance of two lines of the legend
constexpr int kGap = 20;                // between two plots
constexpr double kNames = kRight + 48;  // x at which the names begin
constexpr double kNameWidth = kWidth - 4 - kNames;

// People who see colours differently can tell the first eight apart (Okabe and Ito 2008).
constexpr std::array<Colour, 12> kColours = {{{0x00, 0x72, 0xb2},
                                              {0xd5, 0x5e, 0x00},
                                              {0x00, 0x9e, 0x73},
                                              {0xcc, 0x79, 0xa7},
                                              {0xe6, 0x9f, 0x00},
                                              {0x56, 0xb4, 0xe9},
                                              {0x00, 0x00, 0x00},
                                              {0xb0, 0xa0, 0x00},
                                              {0x6a, 0x3d, 0x9a},
                                              {0x8c, 0x51, 0x0a},
                                              {0x90, 0x90, 0x90},
                                              {0x00, 0x44, 0x1b}}};
constexpr Colour kGrid{0xdd, 0xdd, 0xdd};
constexpr double kCurveWidth = 1.6, kHalfMark = 4;

using Range = std::pair<double, double>;
using Coordinate = double std::pair<double, double>::*;
using Point = PlotSurface::Point;

Range range_of(const Range& wanted, const std::vector<Curve>& curves, Coordinate coordinate) {
  if (wanted.first < wanted.second) return wanted;
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

std::vector<Tick> ticks_of(const std::vector<Tick>& wanted, const Range& range) {
  if (!wanted.empty()) return wanted;
  std::vector<Tick> ticks;
  for (const double at : round_ticks(range.first, range.second))
    ticks.push_back({at, fmt::format("{:g}", at)});
  return ticks;
}

using Legend = std::vector<std::vector<std::string>>;  // lines of every name

// Breaks a name between words into lines that fit into the legend. A longer word keeps its line.
template <typename Surface>
std::vector<std::string> lines_of(const std::string& name) {
  std::vector<std::string> lines(1);
  std::istringstream words(name);
  for (std::string word; words >> word;) {
    std::string& line = lines.back();
    if (line.empty())
      line = word;
    else if (Surface::text_width(line + " " + word) <= kNameWidth)
      line += " " + word;
    else
      lines.push_back(word);
  }
  return lines;
}

template <typename Surface>
Legend legend_of(const std::vector<Curve>& curves) {
  Legend legend;
  for (const Curve& curve : curves) legend.push_back(lines_of<Surface>(curve.name));
  return legend;
}

// Returns the height of a plot in pixels.
int height_for(const PlotAxes& axes, const Legend& legend) {
  std::size_t lines = 0;
  for (const auto& name : legend) lines += name.size();
  return std::max(axes.height_px, static_cast<int>(kTop + kLine * static_cast<double>(lines)));
}

class Plot {
 public:
  Plot(const PlotAxes& axes, const std::vector<Curve>& curves, const Legend& legend,
       PlotSurface& surface)
      : axes_(axes),
        curves_(curves),
        legend_(legend),
        surface_(surface),
        height_(height_for(axes, legend)),
        bottom_(height_ - kBelow),
        x_(range_of(axes.x_range, curves, &Range::first)),
        y_(range_of(axes.y_range, curves, &Range::second)) {}

  void draw() const {
    draw_axes();
    double y = kTop + 12;
    for (std::size_t i = 0; i < curves_.size(); ++i) {
      const Colour& colour = kColours[i % kColours.size()];
      draw_curve(curves_[i], colour);
      draw_errors(curves_[i], colour);
      surface_.draw_line({{kRight + 15, y - 5}, {kRight + 40, y - 5}}, 3, colour);
      for (const std::string& line : legend_[i]) {
        surface_.draw_text({kNames, y}, Anchor::kStart, line);
        y += kLine;
      }
    }
  }

 private:
  void draw_axes() const {
    for (const Tick& tick : ticks_of(axes_.x_ticks, x_)) {
      const double x = at_x(tick.at);
      surface_.draw_line({{x, kTop}, {x, bottom_}}, 1, kGrid);
      surface_.draw_text({x, bottom_ + 20}, Anchor::kMiddle, tick.label);
    }
    for (const Tick& tick : ticks_of(axes_.y_ticks, y_)) {
      const double y = at_y(tick.at);
      surface_.draw_line({{kLeft, y}, {kRight, y}}, 1, kGrid);
      surface_.draw_text({kLeft - 6, y + 5}, Anchor::kEnd, tick.label);
    }
    surface_.draw_text({(kLeft + kRight) / 2, height_ - 10.0}, Anchor::kMiddle, axes_.x_title);
    surface_.draw_text({kLeft, kTop - 10}, Anchor::kStart, axes_.y_title);
  }

  // Draws a curve in pieces between points that are not finite.
  void draw_curve(const Curve& curve, const Colour& colour) const {
    std::vector<Point> piece;
    const auto end_piece = [&] {
      if (piece.size() > 1) surface_.draw_line(piece, kCurveWidth, colour);
      piece.clear();
    };
    for (const auto& [x, y] : curve.points) {
      if (std::isfinite(x) && std::isfinite(y))
        piece.push_back({at_x(x), std::clamp(at_y(y), kTop, bottom_)});
      else
        end_piece();
    }
    end_piece();
  }

  // Draws marks and error bars, if the curve has errors.
  void draw_errors(const Curve& curve, const Colour& colour) const {
    for (std::size_t i = 0; i < curve.errors.size(); ++i) {
      const auto [x, y] = curve.points[i];
      const auto in_area = [&](double value) { return std::clamp(at_y(value), kTop, bottom_); };
      surface_.draw_line(
          {{at_x(x), in_area(y - curve.errors[i])}, {at_x(x), in_area(y + curve.errors[i])}},
          kCurveWidth, colour);
      surface_.draw_line({{at_x(x) - kHalfMark, in_area(y)}, {at_x(x) + kHalfMark, in_area(y)}},
                         2 * kHalfMark, colour);
    }
  }

  double at_x(double x) const {
    return kLeft + (x - x_.first) / (x_.second - x_.first) * (kRight - kLeft);
  }
  double at_y(double y) const {
    return bottom_ - (y - y_.first) / (y_.second - y_.first) * (bottom_ - kTop);
  }

  const PlotAxes& axes_;
  const std::vector<Curve>& curves_;
  const Legend& legend_;
  PlotSurface& surface_;
  int height_;
  double bottom_;
  Range x_, y_;
};

// Moves what is drawn down by a number of pixels.
class LoweredSurface : public PlotSurface {
 public:
  LoweredSurface(PlotSurface& surface, double by) : surface_(surface), by_(by) {}

  void draw_line(const std::vector<Point>& points, double width, const Colour& colour) override {
    std::vector<Point> lowered = points;
    for (Point& point : lowered) point.y += by_;
    surface_.draw_line(lowered, width, colour);
  }
  void draw_text(Point at, Anchor anchor, std::string_view text) override {
    surface_.draw_text({at.x, at.y + by_}, anchor, text);
  }

 private:
  PlotSurface& surface_;
  double by_;
};

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
  const double slack = 1e-9 * step;  // keeps ticks at the very ends
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack; ++k)
    ticks.push_back(k * step + 0.0);  // no minus before a zero
  return ticks;
}

std::vector<Tick> log_ticks(double low, double high) {
  const bool has_many = high / low > 2e3;
  std::vector<Tick> ticks;
  for (double decade = std::pow(10, std::floor(std::log10(low)));
       decade <= high && std::isfinite(decade); decade *= 10) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double at = factor * decade;
      if (at < low || at > high || (has_many && factor > 1)) continue;
      ticks.push_back({std::log10(at), fmt::format("{:g}", at)});
    }
  }
  return ticks;
}

std::pair<double, double> range_with_room(const std::vector<Curve>& curves, double least_room) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Curve& curve : curves) {
    for (const auto& point : curve.points) {
      if (!std::isfinite(point.second)) continue;
      low = std::min(low, point.second);
      high = std::max(high, point.second);
    }
  }
  const double room = std::max(0.08 * (high - low), least_room);
  return {low - room, high + room};
}

base::Html curve_plot_svg(const PlotAxes& axes, const std::vector<Curve>& curves) {
  const Legend legend = legend_of<SvgSurface>(curves);
  SvgSurface surface(kWidth, height_for(axes, legend));
  Plot(axes, curves, legend, surface).draw();
  return surface.element();
}

void write_curve_plots(const std::vector<CurvePlot>& plots, const std::filesystem::path& path) {
  std::vector<Legend> legends;
  int height = -kGap;
  for (const CurvePlot& plot : plots) {
    legends.push_back(legend_of<PngSurface>(plot.curves));
    height += height_for(plot.axes, legends.back()) + kGap;
  }
  PngSurface surface(kWidth, height);
  double top = 0;
  for (std::size_t i = 0; i < plots.size(); ++i) {
    LoweredSurface area(surface, top);
    Plot(plots[i].axes, plots[i].curves, legends[i], area).draw();
    top += height_for(plots[i].axes, legends[i]) + kGap;
  }
  surface.write(path);
}

void write_curve_plot(const PlotAxes& axes, const std::vector<Curve>& curves,
                      const std::filesystem::path& path) {
  write_curve_plots({{axes, curves}}, path);
}

}  // namespace tomofield::report
