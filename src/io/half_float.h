#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace tomofield::io {

/// Converts IEEE 754 binary16 bits to float, exactly for every input.
inline float float_from_half(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000u) << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1fu;
  const std::uint32_t fraction = half & 0x3ffu;
  if (exponent == 0) {  // zero or subnormal: fraction · 2⁻²⁴
    const float magnitude = static_cast<float>(fraction) * 0x1p-24f;
    return sign != 0 ? -magnitude : magnitude;
  }
  const std::uint32_t wide_exponent = exponent == 0x1f ? 0xffu : exponent + 112;
  return std::bit_cast<float>(sign | (wide_exponent << 23) | (fraction << 13));
}

/// Converts to the nearest binary16, ties to even; finite values beyond ±65504 become ±65504.
inline std::uint16_t half_from_float(float value) {
  constexpr float kLargest = 65504.0f;
  const auto sign =
      static_cast<std::uint16_t>((std::bit_cast<std::uint32_t>(value) >> 16) & 0x8000u);
  if (std::isnan(value)) return sign | 0x7e00u;
  if (std::isinf(value)) return sign | 0x7c00u;
  const float magnitude = std::min(std::fabs(value), kLargest);
  if (magnitude < 0x1p-14f) {  // subnormal: a multiple of 2⁻²⁴
    return sign | static_cast<std::uint16_t>(std::lrint(magnitude * 0x1p24f));
  }
  const auto bits = std::bit_cast<std::uint32_t>(magnitude);
  const std::uint32_t ties_to_even = 0xfffu + ((bits >> 13) & 1u);
  return sign | static_cast<std::uint16_t>((bits + ties_to_even - (112u << 23)) >> 13);
}

}  // namespace tomofield::io
