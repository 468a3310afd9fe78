#pragma once

#include <functional>
#include <map>
#include <vector>

#include "base/statistics.h"

namespace tomofield::alignment {

/// Looks along a line of rotations that all views share for the smallest residual. Each residual is
/// found once.
class AxisLine {
 public:
  /// Returns the residual of each view at a rotation in degrees.
  using Residuals = std::function<std::vector<double>(double)>;

  /// A slope or a bend of the residuals counts if its mean over the views is above
  /// `standard_errors` standard errors.
  AxisLine(Residuals residuals, double standard_errors);

  /// Returns true if the slope of the residuals between both sides of a rotation counts.
  bool leans(double axis_deg, double step_deg);
  /// Returns the rotation a step further downhill, if the residual is smaller there and the slope
  /// between both sides counts; else the rotation itself.
  double downhill(double axis_deg, double step_deg);
  /// Goes downhill by steps until it stays or reaches ±range.
  double descend(double axis_deg, double step_deg, double range_deg);
  /// Returns where the parabola through the residuals at a rotation and a step to each side is
  /// lowest: at most a step away. The step is doubled up to `widest_step_deg` until the bend of the
  /// parabola counts. Returns the rotation itself if none does.
  double lowest(double axis_deg, double step_deg, double widest_step_deg);

 private:
  const std::vector<double>& at(double axis_deg);
  base::MeanGain slope(double axis_deg, double step_deg);

  Residuals residuals_;
  double standard_errors_;
  std::map<double, std::vector<double>> known_;
};

}  // namespace tomofield::alignment
