#pragma once

#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

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
/// Beyond this tilt a ray crosses several times the specimen's thickness and would need an ever
/// wider margin.
inline constexpr double kLargestTilt_deg = 80.0;
inline constexpr double kLargestPosition_px = 1e7;
inline constexpr Interval kPixelSizes_A{1e-3, 1e7};

/// Returns true if a number is finite and lies from −`largest` to `largest`.
constexpr bool is_plausible(double value, double largest = kLargestNumber) {
  return Interval(largest).contains(value);
}

/// Returns true if a number can be the side of a pixel in Å.
constexpr bool is_plausible_pixel_size(double size_A) { return kPixelSizes_A.contains(size_A); }

/// A size, such as a number of voxels or of bytes, that is computed from numbers that come from
/// outside. A negative number and a result of 2^63 or more are no size, and what is computed with
/// them is none either: a chain of products is checked once, where its value is taken.
class CheckedSize {
 public:
  template <std::integral Integer>
  constexpr CheckedSize(Integer size)  // NOLINT: sizes convert, and are checked
      : value_(std::in_range<std::int64_t>(size) && size >= Integer{0}
                   ? static_cast<std::int64_t>(size)
                   : kNone) {}

  friend constexpr CheckedSize operator*(CheckedSize a, CheckedSize b) {
    std::int64_t product = kNone;
    const bool is_size = a.is_size() && b.is_size();
    return is_size && !__builtin_mul_overflow(a.value_, b.value_, &product) ? product : kNone;
  }
  friend constexpr CheckedSize operator+(CheckedSize a, CheckedSize b) {
    std::int64_t sum = kNone;
    const bool is_size = a.is_size() && b.is_size();
    return is_size && !__builtin_add_overflow(a.value_, b.value_, &sum) ? sum : kNone;
  }

  /// Returns the size if it is one and at most `most`.
  constexpr std::optional<std::int64_t> find(
      std::int64_t most = std::numeric_limits<std::int64_t>::max()) const {
    return is_size() && value_ <= most ? std::optional(value_) : std::nullopt;
  }
  /// Says whether this is a size and has a value.
  template <std::integral Integer>
  constexpr bool is(Integer value) const {
    return is_size() && std::cmp_equal(value_, value);
  }

 private:
  static constexpr std::int64_t kNone = -1;
  constexpr bool is_size() const { return value_ != kNone; }

  std::int64_t value_;
};

}  // namespace tomofield::base
