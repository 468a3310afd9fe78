#pragma once

namespace tomofield::testing {

/// Derivative of objective() by a float that it depends on, from both sides; the
/// float is put back.
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
