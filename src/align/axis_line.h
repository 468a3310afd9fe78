#pragma once

#include <functional>
#include <map>

namespace tomofield::align {

/// Looks along a line of rotations that all views share for the smallest residual. Each residual is
/// found once.
class AxisLine {
 public:
  explicit AxisLine(std::function<double(double)> residual);

  /// Returns the one of two rotations that has the smaller residual; the first one if they are
  /// equal.
  double better(double axis_deg, double other_deg);
  /// Goes on from a rotation by steps as long as the residual becomes smaller, until it
  /// reaches ±range.
  double descend(double axis_deg, double step_deg, double range_deg);
  /// Returns where the parabola through the residuals at a rotation and a step to each side is
  /// lowest: at most a step away.
  double lowest(double axis_deg, double step_deg);

 private:
  double at(double axis_deg);

  std::function<double(double)> residual_;
  std::map<double, double> known_;
};

}  // namespace tomofield::align
