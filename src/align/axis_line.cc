#include "align/axis_line.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tomofield::align {

AxisLine::AxisLine(std::function<double(double)> residual) : residual_(std::move(residual)) {}

double AxisLine::at(double axis_deg) {
  const auto [place, is_new] = known_.try_emplace(axis_deg, 0.0);
  if (is_new) place->second = residual_(axis_deg);
  return place->second;
}

double AxisLine::better(double axis_deg, double other_deg) {
  return at(other_deg) < at(axis_deg) ? other_deg : axis_deg;
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
  const double left = at(axis_deg - step_deg), right = at(axis_deg + step_deg);
  const double bend = left - 2 * at(axis_deg) + right;
  if (!(bend > 0.0)) return axis_deg;
  return axis_deg + step_deg * std::clamp(0.5 * (left - right) / bend, -1.0, 1.0);
}

}  // namespace tomofield::align
