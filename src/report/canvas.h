#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace tomofield::report {

using Colour = std::array<std::uint8_t, 3>;
inline constexpr Colour kWhite{255, 255, 255}, kBlack{0, 0, 0};

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

/// The letters of plot labels have 5 × 7 dots above the base line and two rows below it. There are
/// digits, Latin letters, Å µ σ and . , : ; - ( ) / % + = ° ± − ×; everything else is a blank. A
/// dot is `kDot` pixels wide.
constexpr std::int64_t kDot = 2;
constexpr std::int64_t kTextHeight = 7 * kDot;

/// Returns the width of a text in pixels.
std::int64_t text_width(std::string_view text);
/// Draws a UTF-8 text whose base line begins at (x, y).
void draw_text(Canvas& canvas, std::int64_t x, std::int64_t y, std::string_view text,
               const Colour& colour);

}  // namespace tomofield::report
