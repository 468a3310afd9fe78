#include "report/plot_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "report/canvas.h"

namespace tomofield::report {
namespace {

constexpr int kFontSize = 13;  // pixels, of SVG texts

std::int64_t nearest(double value) { return std::lround(value); }

}  // namespace

SvgSurface::SvgSurface(int width, int height)
    : svg_(base::Html::format(
          "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
          "height=\"{1}\" font-family=\"system-ui, sans-serif\" font-size=\"{2}\">\n",
          width, height, kFontSize)) {}

void SvgSurface::draw_line(const std::vector<Point>& points, double width, const Colour& colour) {
  base::Html path;
  for (const Point& point : points)
    path += base::Html::format("{}{:.1f} {:.1f} ", path.empty() ? base::Html("M") : "L", point.x,
                               point.y);
  svg_ += base::Html::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"#{:02x}{:02x}{:02x}\" stroke-width=\"{}\"/>\n", path,
      colour[0], colour[1], colour[2], width);
}

void SvgSurface::draw_text(Point at, Anchor anchor, std::string_view text) {
  const base::Html name = anchor == Anchor::kStart    ? "start"
                          : anchor == Anchor::kMiddle ? base::Html("middle")
                                                      : "end";
  svg_ += base::Html::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", at.x,
                             at.y, name, base::Html::of(text));
}

// The browser chooses the letters: on average they are a little over half as wide as high.
double SvgSurface::text_width(std::string_view text) {
  return 0.56 * kFontSize * static_cast<double>(text.size());
}

PngSurface::PngSurface(int width, int height) : canvas_(width, height, kWhite) {}

void PngSurface::draw_line(const std::vector<Point>& points, double width, const Colour& colour) {
  const int thickness = std::max(1, static_cast<int>(nearest(width)));
  for (std::size_t i = 1; i < points.size(); ++i) {
    canvas_.draw_line(points[i - 1].x, up(points[i - 1].y), points[i].x, up(points[i].y), thickness,
                      colour);
  }
}

void PngSurface::draw_text(Point at, Anchor anchor, std::string_view text) {
  const std::int64_t width = report::text_width(text);
  const std::int64_t before = anchor == Anchor::kStart    ? 0
                              : anchor == Anchor::kMiddle ? width / 2
                                                          : width;
  // A text is whole as far as the picture is wide enough for it.
  constexpr std::int64_t kEdge = 4;
  const std::int64_t last = std::max(kEdge, canvas_.width() - kEdge - width);
  report::draw_text(canvas_, std::clamp(nearest(at.x) - before, kEdge, last), nearest(up(at.y)),
                    text, kBlack);
}

double PngSurface::text_width(std::string_view text) {
  return static_cast<double>(report::text_width(text));
}

}  // namespace tomofield::report
