#pragma once

#include <cstdint>
#include <string_view>

#include "report/canvas.h"

namespace tomofield::report {

/// The letters of plot labels have 5 × 7 dots. There are digits, Latin letters (small ones are
/// drawn as capitals), Å and . , - ( ) / ; everything else is a blank. A dot is `kDot` pixels wide.
constexpr std::int64_t kDot = 2;
constexpr std::int64_t kTextHeight = 7 * kDot;

/// Returns the width of a text in pixels.
std::int64_t text_width(std::string_view text);
/// Draws a UTF-8 text with its lower left corner at (x, y).
void draw_text(Canvas& canvas, std::int64_t x, std::int64_t y, std::string_view text,
               const Colour& colour);

}  // namespace tomofield::report
