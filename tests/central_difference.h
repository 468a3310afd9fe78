#pragma once

namespace tomofield::testing {

/// Returns the derivative of objective() by a float that it depends on, from both sides. Restores
/// the float.
template <typename Objective>
double central_difference(float& parameter, float step, Objective&& objective) {
  const float kept = parameter, up = kept + step, down = kept - step;
  parameter = up;
  const double high = objective();
  parameter = down;
  const double low = objective();
  parameter = kept;
  return (high - low) / (static_cast<double>(up) - static_cast<double>(down));
}

}  // namespace tomofield::testing
