#include "align/start/axis_line.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace tomofield::alignment {
namespace {

std::vector<double> differences(std::vector<double> from, const std::vector<double>& less) {
  std::ranges::transform(from, less, from.begin(), std::minus<>());
  return from;
}

}  // namespace

AxisLine::AxisLine(Residuals residuals, double standard_errors)
    : residuals_(std::move(residuals)), standard_errors_(standard_errors) {}

const std::vector<double>& AxisLine::at(double axis_deg) {
  const auto [place, is_new] = known_.try_emplace(axis_deg);
  if (is_new) place->second = residuals_(axis_deg);
  return place->second;
}

base::MeanGain AxisLine::slope(double axis_deg, double step_deg) {
  return base::mean_gain(differences(at(axis_deg + step_deg), at(axis_deg - step_deg)));
}

bool AxisLine::leans(double axis_deg, double step_deg) {
  const base::MeanGain rise = slope(axis_deg, step_deg);
  return std::abs(rise.mean) > standard_errors_ * rise.error;
}

double AxisLine::downhill(double axis_deg, double step_deg) {
  if (!leans(axis_deg, step_deg)) return axis_deg;
  const double further = axis_deg - std::copysign(step_deg, slope(axis_deg, step_deg).mean);
  return base::mean_gain(differences(at(axis_deg), at(further))).mean > 0.0 ? further : axis_deg;
}

double AxisLine::descend(double axis_deg, double step_deg, double range_deg) {
  while (std::abs(axis_deg) < range_deg) {
    const double further = downhill(axis_deg, step_deg);
    if (further == axis_deg) break;
    axis_deg = further;
  }
  return axis_deg;
}

double AxisLine::lowest(double axis_deg, double step_deg, double widest_step_deg) {
  for (double step = step_deg; step <= widest_step_deg; step *= 2) {
    const std::vector<double>&left = at(axis_deg - step), &middle = at(axis_deg),
          &right = at(axis_deg + step);
    std::vector<double> bends;
    for (std::size_t i = 0; i < middle.size(); ++i)
      bends.push_back(left[i] - 2 * middle[i] + right[i]);
    const base::MeanGain bend = base::mean_gain(bends);
    if (bend.exceeds(standard_errors_))
      return axis_deg - step * std::clamp(0.5 * slope(axis_deg, step).mean / bend.mean, -1.0, 1.0);
  }
  return axis_deg;
}

}  // namespace tomofield::alignment
