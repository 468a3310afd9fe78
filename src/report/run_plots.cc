#include "report/run_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/statistics.h"
#include "report/choice_plot.h"
#include "report/curve_plot.h"
#include "report/pictures.h"

namespace tomofield::report {
namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();  // is not drawn
constexpr const char* kTilt = "tilt, degrees";

double log10_of(double value) { return value > 0 ? std::log10(value) : kNothing; }

bool has_points(const Curve& curve) {
  return std::ranges::any_of(curve.points, [](const auto& p) { return std::isfinite(p.second); });
}

// Draws the curves that have points.
std::string plot(const PlotAxes& axes, std::vector<Curve> curves) {
  std::erase_if(curves, [](const Curve& curve) { return !has_points(curve); });
  return curves.empty() ? "" : curve_plot_svg(axes, curves);
}

std::string name_of(const char* curve, const NamedFit& fit) {
  return fit.name.empty() ? curve : fmt::format("{}, {}", curve, fit.name);
}

// Returns a curve of numbers, one an epoch.
Curve epoch_curve(std::string name, const std::vector<double>& values) {
  Curve curve{std::move(name), {}};
  for (const double value : values)
    curve.points.emplace_back(static_cast<double>(curve.points.size() + 1), log10_of(value));
  return curve;
}

// Returns value_of(view) of each view over its tilt, in order of tilt.
template <typename ValueOf>
Curve tilt_curve(std::string name, const record::FitMetrics& metrics, const ValueOf& value_of) {
  Curve curve{std::move(name), {}};
  for (std::size_t view = 0; view < metrics.views.size(); ++view)
    curve.points.emplace_back(metrics.views[view].tilt_deg, value_of(view));
  std::ranges::sort(curve.points);
  return curve;
}

// Returns a number of each view over its tilt.
Curve tilt_curve(std::string name, const record::FitMetrics& metrics,
                 double record::ViewMetrics::*number) {
  return tilt_curve(std::move(name), metrics,
                    [&](std::size_t view) { return metrics.views[view].*number; });
}

// Gives the points of a curve marks.
Curve with_marks(Curve curve) {
  std::erase_if(curve.points, [](const auto& p) { return !std::isfinite(p.second); });
  curve.errors.assign(curve.points.size(), 0.0);
  return curve;
}

}  // namespace

std::string loss_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    curves.push_back(epoch_curve(name_of("fitted views", fit), fit.metrics().data_loss));
    if (const auto& held_out = fit.metrics().held_out)
      curves.push_back(epoch_curve(name_of("held-out views", fit), held_out->error_by_epoch));
  }
  const auto range = range_with_room(curves, 0.02);
  if (!std::isfinite(range.first)) return "";
  return plot({.x_title = "epoch",
               .y_title = "mean squared residual over the noise's variance",
               .y_range = range,
               .y_ticks = log_ticks(std::pow(10, range.first), std::pow(10, range.second))},
              curves);
}

std::string trials_plot(const std::optional<tune::TunedFit>& tuned) {
  if (!tuned) return "";
  const CurvePlot choice = choice_plot(*tuned);
  return curve_plot_svg(choice.axes, choice.curves);
}

std::string residual_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    const record::FitMetrics& metrics = fit.metrics();
    curves.push_back(tilt_curve(name_of("fitted views", fit), metrics, [&](std::size_t view) {
      return metrics.views[view].residual.value_or(kNothing);
    }));
    if (!metrics.held_out) continue;
    const measurement::ViewErrors& errors = metrics.held_out->errors;
    Curve held_out{name_of("held-out views", fit), {}};
    for (std::size_t i = 0; i < errors.views.size(); ++i)
      held_out.points.emplace_back(
          metrics.views[static_cast<std::size_t>(errors.views[i])].tilt_deg, errors.view_error[i]);
    std::ranges::sort(held_out.points);
    curves.push_back(with_marks(std::move(held_out)));
  }
  const auto [low, high] = range_with_room(curves, 0.05);
  return plot({.x_title = kTilt,
               .y_title = "mean squared residual over the noise's variance",
               .y_range = {std::min(low, 0.9), std::max(high, 1.1)}},
              curves);
}

std::string scale_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    curves.push_back(tilt_curve(name_of("scale", fit), fit.metrics(), &record::ViewMetrics::scale));
    curves.push_back(
        tilt_curve(name_of("weight in the fit", fit), fit.metrics(), &record::ViewMetrics::weight));
  }
  return plot({.x_title = kTilt, .y_title = "factor", .y_range = range_with_room(curves, 0.02)},
              curves);
}

std::string offset_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    curves.push_back(
        tilt_curve(name_of("offset", fit), fit.metrics(), &record::ViewMetrics::offset));
    curves.push_back(tilt_curve(name_of("noise (standard deviation)", fit), fit.metrics(),
                                &record::ViewMetrics::noise_sigma));
  }
  return plot({.x_title = kTilt,
               .y_title = "line integral, units of the views",
               .y_range = range_with_room(curves, 1e-9)},
              curves);
}

std::string displacement_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    const std::optional<verdict::ViewAgreement>& compared = fit.fit.verdict.views;
    if (!compared) continue;
    const char* const names[] = {"across the tilt axis (x)", "along the tilt axis (y)"};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      Curve curve{name_of(names[axis], fit), {}};
      for (std::size_t i = 0; i < compared->views.size(); ++i)
        curve.points.emplace_back(
            fit.metrics().views[static_cast<std::size_t>(compared->views[i])].tilt_deg,
            compared->displacement_px[i][axis]);
      curves.push_back(with_marks(std::move(curve)));
    }
  }
  const auto [low, high] = range_with_room(curves, 0.05);
  return plot({.x_title = kTilt,
               .y_title = "pixels of the fit",
               .y_range = {std::min(low, -0.5), std::max(high, 0.5)}},
              curves);
}

std::string masked_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const NamedFit& fit : fits) {
    const output::MaskedViews& mask = fit.metrics().mask;
    if (!(mask.mean_part() > 0)) continue;
    curves.push_back(tilt_curve(name_of("masked pixels", fit), fit.metrics(),
                                [&](std::size_t view) { return mask.part[view] / 0.01; }));
  }
  return plot({.x_title = kTilt,
               .y_title = "per cent of the view",
               .y_range = {0, range_with_room(curves, 0.5).second}},
              curves);
}

std::string halves_plot(const evaluate::Fsc& fsc) {
  if (fsc.frequency_per_A.empty()) return "";
  std::vector<Curve> curves{fsc_curve("both halves", fsc.frequency_per_A, fsc.all.correlation)};
  if (fsc.measured)
    curves.push_back(
        fsc_curve("measured directions", fsc.frequency_per_A, fsc.measured->correlation));
  if (fsc.missing)
    curves.push_back(fsc_curve("missing wedge", fsc.frequency_per_A, fsc.missing->correlation));
  return plot(fsc_axes(fsc.frequency_per_A.back()), curves);
}

std::string histogram_plot(const std::vector<float>& voxels) {
  constexpr int kBins = 120;
  if (voxels.empty()) return "";
  const double black = base::percentile(voxels, 0.5), white = base::percentile(voxels, 99.5);
  const double low = 1.5 * black - 0.5 * white, width = 2 * (white - black) / kBins;
  if (!(width > 0)) return "";
  std::vector<double> counts(kBins);
  for (const float voxel : voxels) {
    const double bin = (static_cast<double>(voxel) - low) / width;
    if (bin >= 0 && bin < kBins) counts[static_cast<std::size_t>(bin)] += 1;
  }
  Curve curve{"voxels", {}};
  double most = 0;
  for (int bin = 0; bin < kBins; ++bin) {
    const double percent =
        100 * counts[static_cast<std::size_t>(bin)] / static_cast<double>(voxels.size());
    curve.points.emplace_back(low + bin * width, percent);
    curve.points.emplace_back(low + (bin + 1) * width, percent);
    most = std::max(most, percent);
  }
  return plot({.x_title = "density, units of the file",
               .y_title = "per cent of the voxels",
               .y_range = {0, 1.05 * most}},
              {curve,
               {"shown black at first", {{black, 0}, {black, most}}},
               {"shown white at first", {{white, 0}, {white, most}}}});
}

}  // namespace tomofield::report
