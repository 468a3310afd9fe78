#include "report/canvas.h"

#include <algorithm>
#include <cmath>

#include "io/png.h"

namespace tomofield::report {

Canvas::Canvas(std::int64_t width, std::int64_t height, const Colour& background)
    : width_(width), height_(height), pixels_(static_cast<std::size_t>(3 * width * height)) {
  fill(0, 0, width, height, background);
}

void Canvas::fill(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1,
                  const Colour& colour) {
  for (std::int64_t y = std::max<std::int64_t>(y0, 0); y < std::min(y1, height_); ++y) {
    for (std::int64_t x = std::max<std::int64_t>(x0, 0); x < std::min(x1, width_); ++x)
      std::ranges::copy(colour, pixels_.begin() + 3 * ((height_ - 1 - y) * width_ + x));
  }
}

void Canvas::draw_line(double x0, double y0, double x1, double y1, int thickness,
                       const Colour& colour) {
  const int steps = 1 + static_cast<int>(std::max(std::abs(x1 - x0), std::abs(y1 - y0)));
  for (int i = 0; i <= steps; ++i) {
    const double t = static_cast<double>(i) / steps;
    const auto x = static_cast<std::int64_t>(std::lround(x0 + t * (x1 - x0))) - thickness / 2;
    const auto y = static_cast<std::int64_t>(std::lround(y0 + t * (y1 - y0))) - thickness / 2;
    fill(x, y, x + thickness, y + thickness, colour);
  }
}

void Canvas::write(const std::filesystem::path& path) const {
  io::write_png_rgb(path, width_, height_, pixels_);
}

}  // namespace tomofield::report
