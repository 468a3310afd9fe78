#include "align/axis_line.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "align/mean_gain.h"

namespace tomofield::align {

AxisLine::AxisLine(Residuals residuals, double standard_errors)
    : residuals_(std::move(residuals)), standard_errors_(standard_errors) {}

const std::vector<double>& AxisLine::at(double axis_deg) {
  const auto [place, is_new] = known_.try_emplace(axis_deg);
  if (is_new) place->second = residuals_(axis_deg);
  return place->second;
}

double AxisLine::sum_at(double axis_deg) {
  const std::vector<double>& residuals = at(axis_deg);
  return std::accumulate(residuals.begin(), residuals.end(), 0.0);
}

bool AxisLine::is_lower(double axis_deg, double other_deg) {
  if (standard_errors_ == 0.0) return sum_at(axis_deg) < sum_at(other_deg);
  std::vector<double> gains = at(other_deg);
  std::ranges::transform(gains, at(axis_deg), gains.begin(), std::minus<>());
  return mean_gain(gains).exceeds(standard_errors_);
}

double AxisLine::better(double axis_deg, double other_deg) {
  return is_lower(other_deg, axis_deg) ? other_deg : axis_deg;
}

double AxisLine::descend(double axis_deg, double step_deg, double range_deg) {
  while (std::abs(axis_deg) < range_deg) {
    const double lower = better(better(axis_deg, axis_deg - step_deg), axis_deg + step_deg);
    if (lower == axis_deg) break;
    axis_deg = lower;
  }
  return axis_deg;
}

double AxisLine::lowest(double axis_deg, double step_deg) {
  const double below = axis_deg - step_deg, above = axis_deg + step_deg;
  if (!is_lower(below, above) && !is_lower(above, below)) return axis_deg;
  const double left = sum_at(below), right = sum_at(above);
  const double bend = left - 2 * sum_at(axis_deg) + right;
  if (!(bend > 0.0)) return axis_deg;
  return axis_deg + step_deg * std::clamp(0.5 * (left - right) / bend, -1.0, 1.0);
}

}  // namespace tomofield::align
