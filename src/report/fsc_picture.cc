#include "report/fsc_picture.h"

#include <fmt/core.h>

#include "report/line_plot.h"

namespace tomofield::report {

void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path) {
  LinePlot plot;
  plot.x_label = "resolution (Å)";
  plot.y_label = "FSC";
  plot.x = fsc.frequency_per_A;
  plot.x_high = fsc.frequency_per_A.back();
  plot.y_low = -0.2;
  plot.y_high = 1.05;
  plot.y_ticks = {{0.0, "0"}, {0.143, "0.143"}, {0.5, "0.5"}, {1.0, "1"}};
  constexpr int kTicks = 6;
  for (int tick = 1; tick <= kTicks; ++tick) {
    const double frequency = plot.x_high * tick / kTicks;
    plot.x_ticks.push_back({frequency, fmt::format("{:.3g}", 1.0 / frequency)});
  }
  plot.lines.push_back({"all", {0, 0, 0}, fsc.all.correlation});
  if (fsc.measured) plot.lines.push_back({"measured", {30, 100, 200}, fsc.measured->correlation});
  if (fsc.missing) plot.lines.push_back({"missing wedge", {230, 120, 0}, fsc.missing->correlation});
  write_line_plot(plot, path);
}

}  // namespace tomofield::report
