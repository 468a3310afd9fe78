#include "align/axis_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "base/log.h"
#include "base/trace.h"

namespace tomofield::align {
namespace {

constexpr double kRadian_deg = 180.0 / std::numbers::pi;
constexpr double kRange_deg = 6.0, kFirstStep_deg = 2.0;
// The last parabola has its points so far apart: closer ones differ by less than the fits do.
constexpr double kLastStep_deg = 0.5;

std::vector<geometry::ViewCorrection> turned(std::vector<geometry::ViewCorrection> corrections,
                                             double axis_deg) {
  for (geometry::ViewCorrection& correction : corrections)
    correction = correction.then({.rotation_rad = axis_deg / kRadian_deg});
  return corrections;
}

// Returns where the parabola through three values, one step apart, is lowest, in steps from the
// middle one.
double lowest_place(double left, double middle, double right) {
  const double bend = left - 2 * middle + right;
  return bend > 0 ? std::clamp(0.5 * (left - right) / bend, -1.0, 1.0) : 0.0;
}

}  // namespace

std::vector<geometry::ViewCorrection> with_best_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes) {
  const base::TraceSpan span("find tilt axis");
  std::map<double, double> known;
  const auto residual_at = [&](double axis_deg) {
    const auto [place, is_new] = known.try_emplace(axis_deg, 0.0);
    if (is_new) place->second = coarse_residual(problem, turned(start, axis_deg), processes);
    return place->second;
  };
  double best = 0.0;
  for (double axis = -kRange_deg; axis <= kRange_deg; axis += kFirstStep_deg)
    if (residual_at(axis) < residual_at(best)) best = axis;
  for (double step = kFirstStep_deg / 2; step >= kLastStep_deg; step /= 2)
    for (const double axis : {best - step, best + step})
      if (residual_at(axis) < residual_at(best)) best = axis;
  const double axis_deg =
      best + kLastStep_deg * lowest_place(residual_at(best - kLastStep_deg), residual_at(best),
                                          residual_at(best + kLastStep_deg));
  base::log_info(
      fmt::format("the tilt axis is turned by {:.2f}° from where the files have it", axis_deg));
  return turned(start, axis_deg);
}

}  // namespace tomofield::align
