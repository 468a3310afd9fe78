#include "report/alignment_plot.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/check.h"

namespace tomofield::report {
namespace {

constexpr const char* kTilt = "tilt, degrees";
constexpr const char* kAcross = "across the tilt axis (x)";
constexpr const char* kAlong = "along the tilt axis (y)";
constexpr int kHeight_px = 270;

// Returns the root mean square of the displacements of the nodes.
double rms_of(const geometry::ViewWarp& motion) {
  double squares = 0.0;
  for (const auto& [x, y] : motion.nodes) squares += x * x + y * y;
  return std::sqrt(squares / static_cast<double>(motion.nodes.size()));
}

// Returns the values of the views in order of tilt.
Curve tilt_curve(std::string name, const AlignmentCurves& alignment,
                 const std::vector<double>& values) {
  TOMOFIELD_CHECK(!values.empty() && values.size() == alignment.tilt_deg.size(),
                  "each view has one value");
  Curve curve{std::move(name), {}};
  for (std::size_t view = 0; view < values.size(); ++view)
    curve.points.emplace_back(alignment.tilt_deg[view], values[view]);
  std::ranges::sort(curve.points, {}, &std::pair<double, double>::first);
  return curve;
}

// Returns ticks at the multiples of 20° among the tilts, or none if there are fewer than two.
std::vector<Tick> tilt_ticks(const Curve& curve) {
  constexpr int kStep_deg = 20;
  const double low = curve.points.front().first, high = curve.points.back().first;
  std::vector<Tick> ticks;
  for (int tilt_deg = -180; tilt_deg <= 180; tilt_deg += kStep_deg) {
    if (tilt_deg >= low && tilt_deg <= high)
      ticks.push_back({static_cast<double>(tilt_deg), std::to_string(tilt_deg)});
  }
  if (ticks.size() < 2) ticks.clear();
  return ticks;
}

// Returns a plot whose y axis has room around the values and is no shorter than `least_extent`.
CurvePlot plot_of(std::string title, std::vector<Curve> curves, double least_extent) {
  const auto range = range_with_room(curves, least_extent / 2);
  return {{.x_title = kTilt,
           .y_title = std::move(title),
           .y_range = std::isfinite(range.first) ? range : std::pair{0.0, 0.0},
           .x_ticks = tilt_ticks(curves.front()),
           .height_px = kHeight_px},
          std::move(curves)};
}

bool has_change(const std::vector<double>& values) {
  return std::ranges::any_of(values, [](double v) { return std::isfinite(v) && v != 0.0; });
}

}  // namespace

AlignmentCurves alignment_curves(const alignment::AlignmentRecord& record) {
  AlignmentCurves curves;
  for (const alignment::AlignedView& view : record.views) {
    curves.tilt_deg.push_back(view.tilt_deg);
    curves.shift_x_px.push_back(view.shift_px[0]);
    curves.shift_y_px.push_back(view.shift_px[1]);
    curves.rotation_deg.push_back(view.rotation_deg);
    curves.magnification_percent.push_back(100 * std::expm1(view.log_magnification));
    curves.tilt_change_deg.push_back(view.tilt_change_deg);
    curves.local_px.push_back(view.local ? rms_of(*view.local) : 0.0);
    curves.correlation.push_back(view.agreement.correlation);
    curves.error_x_px.push_back(view.agreement.error_px[0]);
    curves.error_y_px.push_back(view.agreement.error_px[1]);
  }
  return curves;
}

std::vector<CurvePlot> alignment_plots(const AlignmentCurves& alignment) {
  std::vector<CurvePlot> plots;
  plots.push_back(plot_of("change of the shift, pixels before binning",
                          {tilt_curve(kAcross, alignment, alignment.shift_x_px),
                           tilt_curve(kAlong, alignment, alignment.shift_y_px)},
                          0.1));
  if (has_change(alignment.rotation_deg)) {
    plots.push_back(plot_of("change of the rotation, degrees",
                            {tilt_curve("rotation", alignment, alignment.rotation_deg)}, 0.02));
  }
  if (has_change(alignment.magnification_percent)) {
    plots.push_back(
        plot_of("change of the magnification, per cent",
                {tilt_curve("magnification", alignment, alignment.magnification_percent)}, 0.02));
  }
  if (has_change(alignment.tilt_change_deg)) {
    plots.push_back(plot_of("change of the tilt angle, degrees",
                            {tilt_curve("tilt angle", alignment, alignment.tilt_change_deg)},
                            0.05));
  }
  if (has_change(alignment.local_px)) {
    plots.push_back(plot_of("local motion, pixels before binning",
                            {tilt_curve("root mean square", alignment, alignment.local_px)}, 0.1));
  }
  plots.push_back(plot_of("correlation of the view with its projection",
                          {tilt_curve("correlation", alignment, alignment.correlation)}, 0.02));
  plots.push_back(plot_of("standard error of the shift, pixels before binning",
                          {tilt_curve(kAcross, alignment, alignment.error_x_px),
                           tilt_curve(kAlong, alignment, alignment.error_y_px)},
                          0.01));
  auto& error_range = plots.back().axes.y_range;
  if (error_range.second > 0) error_range.first = 0;
  return plots;
}

void write_alignment_picture(const AlignmentCurves& alignment, const std::filesystem::path& path) {
  write_curve_plots(alignment_plots(alignment), path);
}

}  // namespace tomofield::report
