#include "report/run_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/statistics.h"
#include "io/json.h"
#include "report/choice_plot.h"
#include "report/curve_plot.h"
#include "report/pictures.h"
#include "tune/trial_record.h"

namespace tomofield::report {
namespace {

using nlohmann::json;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();  // is not drawn
constexpr const char* kTilt = "tilt, degrees";

double log10_of(double value) { return value > 0 ? std::log10(value) : kNothing; }

bool has_points(const Curve& curve) {
  return std::ranges::any_of(curve.points, [](const auto& p) { return std::isfinite(p.second); });
}

// Draws the curves that have points.
base::Html plot(const PlotAxes& axes, std::vector<Curve> curves) {
  std::erase_if(curves, [](const Curve& curve) { return !has_points(curve); });
  return curves.empty() ? "" : curve_plot_svg(axes, curves);
}

// Returns a member of an object, or null if it is not there.
const json& member(const json& object, const char* key) {
  static const json kNull;
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found == object.end() ? kNull : *found;
}

std::string name_of(const char* curve, const FitMetrics& fit) {
  return fit.name.empty() ? curve : fmt::format("{}, {}", curve, fit.name);
}

// Returns a curve of an array of numbers, one an epoch.
Curve epoch_curve(std::string name, const json& values) {
  Curve curve{std::move(name), {}};
  for (const json& value : values)
    curve.points.emplace_back(static_cast<double>(curve.points.size() + 1),
                              log10_of(io::number_or_nan(value)));
  return curve;
}

// Returns a number of each view over its tilt, in order of tilt.
Curve tilt_curve(std::string name, const json& views, const char* key, double unit = 1.0) {
  Curve curve{std::move(name), {}};
  for (const json& view : views)
    curve.points.emplace_back(io::number_or_nan(member(view, "tilt_deg")),
                              io::number_or_nan(member(view, key)) / unit);
  std::ranges::sort(curve.points);
  return curve;
}

// Gives the points of a curve marks.
Curve with_marks(Curve curve) {
  std::erase_if(curve.points, [](const auto& p) { return !std::isfinite(p.second); });
  curve.errors.assign(curve.points.size(), 0.0);
  return curve;
}

}  // namespace

base::Html loss_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    curves.push_back(epoch_curve(name_of("fitted views", fit),
                                 member(fit.metrics, "mean_squared_residual_per_noise_variance")));
    curves.push_back(epoch_curve(name_of("held-out views", fit),
                                 member(member(fit.metrics, "held_out"), "error_by_epoch")));
  }
  const auto range = range_with_room(curves, 0.02);
  if (!std::isfinite(range.first)) return "";
  return plot({.x_title = "epoch",
               .y_title = "mean squared residual over the noise's variance",
               .y_range = range,
               .y_ticks = log_ticks(std::pow(10, range.first), std::pow(10, range.second))},
              curves);
}

base::Html trials_plot(const json& metrics) {
  const json& tuning = member(metrics, "tuning");
  if (!tuning.is_object()) return "";
  const CurvePlot choice = choice_plot(tune::tuned_from(tuning));
  return curve_plot_svg(choice.axes, choice.curves);
}

base::Html residual_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    curves.push_back(
        tilt_curve(name_of("fitted views", fit), member(fit.metrics, "views"), "residual"));
    curves.push_back(
        with_marks(tilt_curve(name_of("held-out views", fit),
                              member(member(fit.metrics, "held_out"), "views"), "error")));
  }
  const auto [low, high] = range_with_room(curves, 0.05);
  return plot({.x_title = kTilt,
               .y_title = "mean squared residual over the noise's variance",
               .y_range = {std::min(low, 0.9), std::max(high, 1.1)}},
              curves);
}

base::Html scale_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    const json& views = member(fit.metrics, "views");
    curves.push_back(tilt_curve(name_of("scale", fit), views, "scale"));
    curves.push_back(tilt_curve(name_of("weight in the fit", fit), views, "weight"));
  }
  return plot({.x_title = kTilt, .y_title = "factor", .y_range = range_with_room(curves, 0.02)},
              curves);
}

base::Html offset_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    const json& views = member(fit.metrics, "views");
    curves.push_back(tilt_curve(name_of("offset", fit), views, "offset"));
    curves.push_back(tilt_curve(name_of("noise (standard deviation)", fit), views, "noise_sigma"));
  }
  return plot({.x_title = kTilt,
               .y_title = "line integral, units of the views",
               .y_range = range_with_room(curves, 1e-9)},
              curves);
}

base::Html displacement_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    const json& compared = member(member(member(fit.metrics, "verdict"), "views"), "compared");
    const char* const names[] = {"across the tilt axis (x)", "along the tilt axis (y)"};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      Curve curve{name_of(names[axis], fit), {}};
      for (const json& view : compared)
        curve.points.emplace_back(
            io::number_or_nan(
                fit.metrics.at("views").at(view.at("view").get<std::size_t>()).at("tilt_deg")),
            io::number_or_nan(view.at("displacement_px").at(axis)));
      curves.push_back(with_marks(std::move(curve)));
    }
  }
  const auto [low, high] = range_with_room(curves, 0.05);
  return plot({.x_title = kTilt,
               .y_title = "pixels of the fit",
               .y_range = {std::min(low, -0.5), std::max(high, 0.5)}},
              curves);
}

base::Html masked_plot(const AllFits& fits) {
  std::vector<Curve> curves;
  for (const FitMetrics& fit : fits) {
    const json& mask = member(fit.metrics, "mask");
    if (io::number_or_nan(member(mask, "masked_part")) > 0)
      curves.push_back(
          tilt_curve(name_of("masked pixels", fit), member(mask, "views"), "masked_part", 0.01));
  }
  return plot({.x_title = kTilt,
               .y_title = "per cent of the view",
               .y_range = {0, range_with_room(curves, 0.5).second}},
              curves);
}

base::Html halves_plot(const json& fsc) {
  if (!fsc.is_object() || !fsc.contains("frequency_per_A")) return "";
  std::vector<double> frequencies;
  for (const json& frequency : fsc["frequency_per_A"])
    frequencies.push_back(io::number_or_nan(frequency));
  if (frequencies.empty()) return "";
  std::vector<Curve> curves;
  const std::pair<const char*, const char*> kinds[] = {
      {"all", "both halves"}, {"measured", "measured directions"}, {"missing", "missing wedge"}};
  for (const auto& [key, name] : kinds) {
    if (!fsc.contains(key)) continue;
    std::vector<double> correlation;
    for (const json& value : fsc[key].at("correlation"))
      correlation.push_back(io::number_or_nan(value));
    correlation.resize(frequencies.size(), kNothing);
    curves.push_back(fsc_curve(name, frequencies, correlation));
  }
  return plot(fsc_axes(frequencies.back()), curves);
}

base::Html histogram_plot(const std::vector<float>& voxels) {
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
