#pragma once

#include <cmath>
#include <numbers>

namespace tomofield::baseline {

/// Returns sin(2π cycles) to 4·10⁻⁶, for |cycles| up to a few thousand, where the rounding of the
/// argument adds as much. It has no branches, so compilers vectorise a loop over it. It removes
/// whole cycles, folds the rest to a quarter, and sums Taylor's series up to the ninth power.
inline float sine_of_cycles(float cycles) {
  constexpr float kRounds = 12582912.0f;  // 1.5 · 2²³: adding it rounds to an integer
  const float part = cycles - ((cycles + kRounds) - kRounds);
  const float quarter = 0.25f - std::abs(std::abs(part) - 0.25f);
  const float a = 2 * std::numbers::pi_v<float> * quarter, s = a * a;
  const float series =
      1 + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880))));
  return std::copysign(a * series, part);
}

}  // namespace tomofield::baseline
