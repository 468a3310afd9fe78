#include "reconstruct/choice_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/enum_names.h"
#include "reconstruct/automatic_choice.h"
#include "report/curve_plot.h"

namespace tomofield::reconstruction {
namespace {

// Trials that predict worse than this many per cent are drawn at the upper end.
constexpr double kMostPercent = 12;

// Weights below this one, such as 0, are drawn at it.
constexpr double kLeastWeight = 0.125;

void add_point(const FitTrial& trial, const TunedFit& tuned, report::Curve& curve) {
  const selection::Difference d = difference_to_chosen(trial, tuned);
  curve.points.emplace_back(std::log2(std::max(trial.settings.variation, kLeastWeight)),
                            100 * d.log_ratio);
  curve.errors.push_back(100 * kClearErrors * d.standard_error);
}

// Returns the curve of a penalty over its weights, which has no points if none was tried.
report::Curve curve_of(Penalty penalty, const TunedFit& tuned) {
  report::Curve curve{.name = fmt::format("{} penalty", base::name_of(penalty)), .points = {}};
  std::vector<FitTrial> trials;
  std::ranges::copy_if(tuned.trials, std::back_inserter(trials), [&](const FitTrial& t) {
    return t.settings.penalty == penalty && differs_from_first_in_variation_alone(t, tuned);
  });
  std::ranges::sort(trials, {}, [](const FitTrial& t) { return t.settings.variation; });
  for (const FitTrial& trial : trials) add_point(trial, tuned, curve);
  return curve;
}

}  // namespace

report::CurvePlot choice_plot(const TunedFit& tuned) {
  std::vector<report::Curve> curves;
  for (const Penalty penalty : {Penalty::kSmooth, Penalty::kConcave}) {
    curves.push_back(curve_of(penalty, tuned));
    if (curves.back().points.empty()) curves.pop_back();
  }
  for (const FitTrial& trial : tuned.trials) {
    if (differs_from_first_in_variation_alone(trial, tuned)) continue;
    curves.push_back(
        {.name = describe(trial.settings, tuned.trials.front().settings), .points = {}});
    add_point(trial, tuned, curves.back());
  }
  report::PlotAxes axes{
      .x_title =
          "weight of total variation, chosen is " + describe(tuned.settings, TrialSettings{}),
      .y_title = "per cent above the chosen, patch by patch; bars of two standard errors",
      .y_range = {-2, kMostPercent}};
  std::vector<double> at;
  for (const report::Curve& curve : curves)
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

void write_choice_plot(const TunedFit& tuned, const std::filesystem::path& path) {
  report::write_curve_plots({choice_plot(tuned)}, path);
}

}  // namespace tomofield::reconstruction
