#pragma once

#include <optional>

namespace tomofield::base {

/// A finite number within an Interval, which alone makes it. Whatever text, JSON, HDF5 or arrays
/// hold becomes one before it is used, so that no reader can leave the check out.
class Finite {
 public:
  constexpr operator double() const { return value_; }  // NOLINT: it is a number

 private:
  friend class Interval;
  explicit constexpr Finite(double value) : value_(value) {}
  double value_;
};

/// The numbers from `low` to `high`, which are finite.
class Interval {
 public:
  constexpr Interval(double low, double high) : low_(low), high_(high) {}
  /// Makes the numbers from −`largest` to `largest`.
  constexpr Interval(double largest) : Interval(-largest, largest) {}  // NOLINT: as readers name it

  constexpr double low() const { return low_; }
  constexpr double high() const { return high_; }
  /// Returns false for NaN, too.
  constexpr bool contains(double value) const { return value >= low_ && value <= high_; }
  /// Returns a number if it lies within the interval.
  constexpr std::optional<Finite> find(double value) const {
    return contains(value) ? std::optional(Finite(value)) : std::nullopt;
  }

 private:
  double low_, high_;
};

// The limits of numbers that come from outside: from files of a series, from options and from JSON.
// A number beyond them is damage or a slip, and arithmetic with it could overflow.

inline constexpr double kLargestNumber = 1e9;
inline constexpr double kLargestAngle_deg = 360.0;
inline constexpr double kLargestPosition_px = 1e7;
inline constexpr Interval kPixelSizes_A{1e-3, 1e7};

/// Returns true if a number is finite and lies from −`largest` to `largest`.
constexpr bool is_plausible(double value, double largest = kLargestNumber) {
  return Interval(largest).contains(value);
}

/// Returns true if a number can be the side of a pixel in Å.
constexpr bool is_plausible_pixel_size(double size_A) { return kPixelSizes_A.contains(size_A); }

}  // namespace tomofield::base
