#pragma once

#include <optional>
#include <type_traits>
#include <utility>

namespace tomofield {

/// Where the value of an option comes from.
enum class Origin {
  kDefault,  ///< nobody chose it yet: other options, the data or trials may
  kGiven,    ///< the user
  kProject,  ///< a file of another program
  kDerived,  ///< other options
  kTrial,    ///< trials on the data
};

/// An option that the program may choose, and the origin of its value. An option is open until
/// somebody chooses its value. An open one may have a usual value, from which trials start.
///
/// It reads and is assigned like a plain value: `options.fit.epochs = 30` is a value that is given.
/// `options.fit.epochs = tomofield::FitOptions().epochs` opens it again.
template <typename T>
class Choice {
 public:
  /// Open, without a value.
  constexpr Choice() = default;
  /// Given.
  constexpr Choice(T value) : value_(std::move(value)), origin_(Origin::kGiven) {}
  constexpr Choice(T value, Origin origin) : value_(std::move(value)), origin_(origin) {}
  /// Returns an open choice with a value that holds as long as nobody chooses another.
  static constexpr Choice usual(T value) { return {std::move(value), Origin::kDefault}; }

  constexpr Origin origin() const { return origin_; }
  constexpr bool is_open() const { return origin_ == Origin::kDefault; }
  /// Returns true if trials may choose the value, or have chosen it.
  constexpr bool is_left_to_trials() const { return is_open() || origin_ == Origin::kTrial; }
  constexpr bool has_value() const { return value_.has_value(); }

  /// Returns the value. Throws std::bad_optional_access if there is none.
  constexpr const T& value() const { return value_.value(); }
  constexpr const T& operator*() const { return value(); }
  constexpr operator const T&() const { return value(); }
  /// "if (choice)" could ask for the value or whether there is one: write which.
  explicit operator bool() const requires(!std::is_same_v<T, bool>) = delete;
  constexpr T value_or(T other) const { return value_.value_or(std::move(other)); }
  /// Returns the value that somebody chose, and `other` while it is open.
  constexpr T chosen_or(T other) const { return is_open() ? std::move(other) : value(); }

  /// Sets the value that trials have chosen.
  constexpr void choose(T value) { *this = {std::move(value), Origin::kTrial}; }
  /// Sets the value of an open choice, and leaves the others.
  constexpr void derive(T value) {
    if (is_open()) *this = {std::move(value), Origin::kDerived};
  }

  /// Compares the values alone; two choices are equal if their origins are, too.
  template <typename U>
  friend constexpr bool operator==(const Choice& a, const U& b) {
    return a.value_.has_value() && *a.value_ == b;
  }
  friend constexpr bool operator==(const Choice& a, const Choice& b) {
    return a.value_ == b.value_ && a.origin_ == b.origin_;
  }

 private:
  std::optional<T> value_;
  Origin origin_ = Origin::kDefault;
};

}  // namespace tomofield
