#pragma once

#include <cmath>
#include <numbers>

namespace tomofield::baseline {

/// sin(2π cycles) to 4·10⁻⁶, for |cycles| up to a few thousand, where rounding of the argument adds
/// as much. Without branches, so that compilers make vectors of a loop over it: whole cycles are
/// taken off, what is left is folded to a quarter, and Taylor's series goes up to the ninth power.
inline float sine_of_cycles(float cycles) {
  constexpr float kRounds = 12582912.0f;  // 1.5 · 2²³: what is added to it becomes an integer
  const float part = cycles - ((cycles + kRounds) - kRounds);
  const float quarter = 0.25f - std::abs(std::abs(part) - 0.25f);
  const float a = 2 * std::numbers::pi_v<float> * quarter, s = a * a;
  const float series =
      1 + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880))));
  return std::copysign(a * series, part);
}

}  // namespace tomofield::baseline
