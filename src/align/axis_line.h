#pragma once

#include <functional>
#include <map>
#include <vector>

namespace tomofield::align {

/// Looks along a line of rotations that all views share for the smallest residual. Each residual is
/// found once.
class AxisLine {
 public:
  /// Returns the residual of each view at a rotation in degrees; or the one of all views, if
  /// differences count whatever their standard error.
  using Residuals = std::function<std::vector<double>(double)>;

  /// A difference of residuals counts if its mean over the views is above so many standard errors.
  /// With 0, its sum counts.
  AxisLine(Residuals residuals, double standard_errors);

  /// Returns the one of two rotations that has the smaller residual; the first one if they do not
  /// differ.
  double better(double axis_deg, double other_deg);
  /// Goes on from a rotation by steps as long as the residual becomes smaller, until it
  /// reaches ±range.
  double descend(double axis_deg, double step_deg, double range_deg);
  /// Returns where the parabola through the residuals at a rotation and a step to each side is
  /// lowest: at most a step away. Returns the rotation itself if its bend does not count, or is
  /// not upwards.
  double lowest(double axis_deg, double step_deg);

 private:
  const std::vector<double>& at(double axis_deg);
  bool is_lower(double axis_deg, double other_deg);
  bool is_positive(const std::vector<double>& differences) const;

  Residuals residuals_;
  double standard_errors_;
  std::map<double, std::vector<double>> known_;
};

}  // namespace tomofield::align
