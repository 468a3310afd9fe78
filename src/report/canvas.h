#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace tomofield::report {

using Colour = std::array<std::uint8_t, 3>;

/// A picture that can be drawn on. x runs to the right and y upwards from the lower left corner.
class Canvas {
 public:
  Canvas(std::int64_t width, std::int64_t height, const Colour& background);

  /// Fills the rectangle of pixels [x0, x1) × [y0, y1), cut to the canvas.
  void fill(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1,
            const Colour& colour);
  /// Draws a straight line between two points, `thickness` pixels wide.
  void draw_line(double x0, double y0, double x1, double y1, int thickness, const Colour& colour);

  std::int64_t width() const { return width_; }
  std::int64_t height() const { return height_; }
  /// Writes a PNG file and replaces `path`. Throws Error if it cannot be written.
  void write(const std::filesystem::path& path) const;

 private:
  std::int64_t width_, height_;
  std::vector<std::uint8_t> pixels_;  // [row from the top][x][channel]
};

}  // namespace tomofield::report
