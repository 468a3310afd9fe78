#pragma once

#include <cmath>

namespace tomofield::base {

// The limits of numbers that come from text: from files of a series, from options and from JSON. A
// number beyond them is damage or a slip, and arithmetic with it could overflow.

inline constexpr double kLargestNumber = 1e9;
inline constexpr double kLargestAngle_deg = 360.0;
inline constexpr double kLargestPosition_px = 1e7;
inline constexpr double kSmallestPixel_A = 1e-3;
inline constexpr double kLargestPixel_A = 1e7;

/// Returns true if a number is finite and lies from −`largest` to `largest`.
inline bool is_plausible(double value, double largest = kLargestNumber) {
  return std::fabs(value) <= largest;  // false for nan
}

/// Returns true if a number can be the side of a pixel in Å.
inline bool is_plausible_pixel_size(double size_A) {
  return size_A >= kSmallestPixel_A && size_A <= kLargestPixel_A;
}

}  // namespace tomofield::base
