#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/code_text.h"
#include "report/canvas.h"

namespace tomofield::report {

/// The point of a text that lies at its position.
enum class Anchor { kStart, kMiddle, kEnd };

/// A surface for plots, in pixels: x to the right and y downwards from the upper left.
class PlotSurface {
 public:
  struct Point {
    double x, y;
  };

  virtual ~PlotSurface() = default;
  virtual void draw_line(const std::vector<Point>& points, double width, const Colour& colour) = 0;
  /// Draws one line of text; `at` is on its base line.
  virtual void draw_text(Point at, Anchor anchor, std::string_view text) = 0;
};

class SvgSurface : public PlotSurface {
 public:
  SvgSurface(int width, int height);
  void draw_line(const std::vector<Point>& points, double width, const Colour& colour) override;
  void draw_text(Point at, Anchor anchor, std::string_view text) override;
  /// Returns the approximate width of a text.
  static double text_width(std::string_view text);
  /// Returns the SVG element.
  base::Html element() const { return base::Html::format("{}</svg>\n", svg_); }

 private:
  base::Html svg_;
};

class PngSurface : public PlotSurface {
 public:
  PngSurface(int width, int height);
  void draw_line(const std::vector<Point>& points, double width, const Colour& colour) override;
  void draw_text(Point at, Anchor anchor, std::string_view text) override;
  /// Returns the width of a text.
  static double text_width(std::string_view text);
  /// Writes a PNG file and replaces `path`. Throws Error if it cannot be written.
  void write(const std::filesystem::path& path) const { canvas_.write(path); }

 private:
  double up(double y) const { return static_cast<double>(canvas_.height()) - 1 - y; }
  Canvas canvas_;
};

}  // namespace tomofield::report
