#include "report/choice_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/enum_names.h"
#include "report/curve_plot.h"
#include "tune/automatic_choice.h"

namespace tomofield::report {
namespace {

// Trials that predict worse than this many per cent are drawn at the upper end.
constexpr double kMostPercent = 12;

// Weights below this one, such as 0, are drawn at it.
constexpr double kLeastWeight = 0.125;

void add_point(const tune::FitTrial& trial, const tune::TunedFit& tuned, Curve& curve) {
  const tune::Difference d = tune::difference_to_chosen(trial, tuned);
  curve.points.emplace_back(std::log2(std::max(trial.settings.variation, kLeastWeight)),
                            100 * d.log_ratio);
  curve.errors.push_back(100 * tune::kClearErrors * d.standard_error);
}

// Returns the curve of a penalty over its weights, which has no points if none was tried.
Curve curve_of(Penalty penalty, const tune::TunedFit& tuned) {
  Curve curve{.name = fmt::format("{} penalty", base::name_of(penalty)), .points = {}};
  std::vector<tune::FitTrial> trials;
  std::ranges::copy_if(tuned.trials, std::back_inserter(trials), [&](const tune::FitTrial& t) {
    return t.settings.penalty == penalty && tune::differs_from_first_in_variation_alone(t, tuned);
  });
  std::ranges::sort(trials, {}, [](const tune::FitTrial& t) { return t.settings.variation; });
  for (const tune::FitTrial& trial : trials) add_point(trial, tuned, curve);
  return curve;
}

}  // namespace

CurvePlot choice_plot(const tune::TunedFit& tuned) {
  std::vector<Curve> curves;
  for (const Penalty penalty : {Penalty::kSmooth, Penalty::kConcave}) {
    curves.push_back(curve_of(penalty, tuned));
    if (curves.back().points.empty()) curves.pop_back();
  }
  for (const tune::FitTrial& trial : tuned.trials) {
    if (tune::differs_from_first_in_variation_alone(trial, tuned)) continue;
    curves.push_back(
        {.name = tune::describe(trial.settings, tuned.trials.front().settings), .points = {}});
    add_point(trial, tuned, curves.back());
  }
  PlotAxes axes{.x_title = "weight of total variation, chosen is " +
                           tune::describe(tuned.settings, tune::TrialSettings{}),
                .y_title = "per cent above the chosen, patch by patch; bars of two standard errors",
                .y_range = {-2, kMostPercent}};
  std::vector<double> at;
  for (const Curve& curve : curves)
    for (const auto& point : curve.points) at.push_back(point.first);
  std::ranges::sort(at);
  axes.x_range = {at.front() - 0.5, at.back() + 0.5};
  for (int weight = 1; weight <= 1024; weight *= 2) {
    const double x = std::log2(weight);
    if (x > axes.x_range.first && x < axes.x_range.second)
      axes.x_ticks.push_back({x, fmt::format("{}", weight)});
  }
  return {std::move(axes), std::move(curves)};
}

void write_choice_plot(const tune::TunedFit& tuned, const std::filesystem::path& path) {
  write_curve_plots({choice_plot(tuned)}, path);
}

}  // namespace tomofield::report
