#pragma once

#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

namespace tomofield::base {

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
