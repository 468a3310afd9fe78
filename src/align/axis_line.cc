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

bool AxisLine::is_positive(const std::vector<double>& differences) const {
  if (standard_errors_ == 0.0)
    return std::accumulate(differences.begin(), differences.end(), 0.0) > 0.0;
  return mean_gain(differences).exceeds(standard_errors_);
}

bool AxisLine::is_lower(double axis_deg, double other_deg) {
  std::vector<double> gains = at(other_deg);
  std::ranges::transform(gains, at(axis_deg), gains.begin(), std::minus<>());
  return is_positive(gains);
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
  const std::vector<double>&left = at(axis_deg - step_deg), &middle = at(axis_deg),
        &right = at(axis_deg + step_deg);
  std::vector<double> bends;
  double slope = 0.0, bend = 0.0;
  for (std::size_t i = 0; i < middle.size(); ++i) {
    bends.push_back(left[i] - 2 * middle[i] + right[i]);
    bend += bends.back();
    slope += left[i] - right[i];
  }
  if (!is_positive(bends)) return axis_deg;
  return axis_deg + step_deg * std::clamp(0.5 * slope / bend, -1.0, 1.0);
}

}  // namespace tomofield::align
