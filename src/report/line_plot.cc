#include "report/line_plot.h"

#include <algorithm>
#include <cmath>

#include "report/text.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kWidth = 720, kHeight = 480;
// The axes' rectangle.
constexpr std::int64_t kLeft = 84, kRight = 690, kBottom = 64, kTop = 440;
constexpr Colour kWhite{255, 255, 255}, kBlack{0, 0, 0}, kGrey{200, 200, 200};

class Axes {
 public:
  explicit Axes(const LinePlot& plot) : plot_(plot), canvas_(kWidth, kHeight, kWhite) {}

  void draw_axes() {
    for (const Tick& tick : plot_.y_ticks) {
      const auto y = static_cast<std::int64_t>(std::lround(y_of(tick.at)));
      canvas_.fill(kLeft, y, kRight, y + 1, kGrey);
      draw_text(canvas_, kLeft - 10 - text_width(tick.label), y - kTextHeight / 2, tick.label,
                kBlack);
    }
    for (const Tick& tick : plot_.x_ticks) {
      const auto x = static_cast<std::int64_t>(std::lround(x_of(tick.at)));
      canvas_.fill(x, kBottom - 6, x + 1, kBottom, kBlack);
      draw_text(canvas_, x - text_width(tick.label) / 2, kBottom - 10 - kTextHeight, tick.label,
                kBlack);
    }
    canvas_.fill(kLeft, kBottom, kRight, kBottom + 1, kBlack);
    canvas_.fill(kLeft, kBottom, kLeft + 1, kTop, kBlack);
    draw_text(canvas_, (kLeft + kRight - text_width(plot_.x_label)) / 2, 10, plot_.x_label, kBlack);
    draw_text(canvas_, kLeft, kTop + 14, plot_.y_label, kBlack);
  }

  void draw_lines() {
    for (const PlotLine& line : plot_.lines) {
      for (std::size_t i = 1; i < line.y.size(); ++i) {
        if (std::isnan(line.y[i - 1]) || std::isnan(line.y[i])) continue;
        canvas_.draw_line(x_of(plot_.x[i - 1]), y_of(line.y[i - 1]), x_of(plot_.x[i]),
                          y_of(line.y[i]), 2, line.colour);
      }
    }
  }

  // Above the axes, the last one ending at their right.
  void draw_names() {
    std::int64_t right = kRight;
    for (auto line = plot_.lines.rbegin(); line != plot_.lines.rend(); ++line) {
      const std::int64_t left = right - text_width(line->name);
      draw_text(canvas_, left, kTop + 14, line->name, line->colour);
      right = left - 24;
    }
  }

  void write(const std::filesystem::path& path) const { canvas_.write(path); }

 private:
  double x_of(double x) const {
    return kLeft + (kRight - kLeft) * (x - plot_.x_low) / (plot_.x_high - plot_.x_low);
  }
  double y_of(double y) const {
    const double part = (y - plot_.y_low) / (plot_.y_high - plot_.y_low);
    return kBottom + (kTop - kBottom) * std::clamp(part, 0.0, 1.0);
  }

  const LinePlot& plot_;
  Canvas canvas_;
};

}  // namespace

void write_line_plot(const LinePlot& plot, const std::filesystem::path& path) {
  Axes axes(plot);
  axes.draw_axes();
  axes.draw_lines();
  axes.draw_names();
  axes.write(path);
}

}  // namespace tomofield::report
