#include "report/fsc_picture.h"

#include <fmt/core.h>

#include <utility>

namespace tomofield::report {

PlotAxes fsc_axes(double highest_frequency_per_A) {
  PlotAxes axes{.x_title = "resolution, Å",
                .y_title = "FSC",
                .x_range = {0, highest_frequency_per_A},
                .y_range = {-0.2, 1.05},
                .y_ticks = {{0.0, "0"}, {0.143, "0.143"}, {0.5, "0.5"}, {1.0, "1"}}};
  constexpr int kTicks = 6;
  for (int tick = 1; tick <= kTicks; ++tick) {
    const double frequency = highest_frequency_per_A * tick / kTicks;
    axes.x_ticks.push_back({frequency, fmt::format("{:.3g}", 1.0 / frequency)});
  }
  return axes;
}

Curve fsc_curve(std::string name, const std::vector<double>& frequency_per_A,
                const std::vector<double>& correlation) {
  Curve curve{std::move(name), {}};
  for (std::size_t shell = 0; shell < frequency_per_A.size(); ++shell)
    curve.points.emplace_back(frequency_per_A[shell], correlation[shell]);
  return curve;
}

void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path) {
  const auto& frequency = fsc.frequency_per_A;
  std::vector<Curve> curves{fsc_curve("all", frequency, fsc.all.correlation)};
  if (fsc.measured) curves.push_back(fsc_curve("measured", frequency, fsc.measured->correlation));
  if (fsc.missing)
    curves.push_back(fsc_curve("missing wedge", frequency, fsc.missing->correlation));
  write_curve_plot(fsc_axes(frequency.back()), curves, path);
}

}  // namespace tomofield::report
