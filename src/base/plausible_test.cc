#include "base/plausible.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>

namespace tomofield::base {
namespace {

constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();

TEST(Interval, LetsFiniteNumbersThrough) {
  constexpr Interval kAngles(360);
  EXPECT_EQ(double{*kAngles.find(-360)}, -360);
  EXPECT_EQ(double{*Interval(1, 2).find(1.5)}, 1.5);
  for (const double number : {361.0, -1e300, std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::quiet_NaN()})
    EXPECT_FALSE(kAngles.find(number)) << number;
  EXPECT_FALSE(Interval(1, 2).contains(0.5));
}

TEST(Finite, IsMadeByAnIntervalAlone) {
  static_assert(!std::is_constructible_v<Finite, double>);
  static_assert(!std::is_default_constructible_v<Finite>);
  static_assert(std::is_convertible_v<Finite, double>);
}

TEST(CheckedSize, IsTheProductOrTheSum) {
  EXPECT_EQ((CheckedSize(3) * 4u * std::size_t{5} + 7).find(), 67);
  EXPECT_EQ((CheckedSize(kLargest - 1) + 1).find(), kLargest);
  EXPECT_EQ((CheckedSize(0) * kLargest).find(), 0);
  EXPECT_TRUE((CheckedSize(3) * 4).is(12));
  EXPECT_FALSE((CheckedSize(3) * 4).is(13));
}

TEST(CheckedSize, IsNoneIfItWouldWrap) {
  constexpr std::int64_t kSide = std::int64_t{1} << 21;
  EXPECT_EQ((CheckedSize(kSide) * kSide * (2 * kSide)).find(), std::nullopt);
  EXPECT_EQ((CheckedSize(std::int64_t{1} << 62) * 4 * 4).find(), std::nullopt);
  EXPECT_EQ((CheckedSize(kLargest) + 1).find(), std::nullopt);
  EXPECT_EQ(CheckedSize(std::numeric_limits<std::uint64_t>::max()).find(), std::nullopt);
  EXPECT_FALSE((CheckedSize(std::int64_t{1} << 32) * (std::int64_t{1} << 32)).is(0));
}

TEST(CheckedSize, StaysNone) {
  const CheckedSize none = CheckedSize(kLargest) * 2;
  for (const CheckedSize size : {none * 0, none + 0, 0 * none, 1 + none, CheckedSize(-1) * -1})
    EXPECT_EQ(size.find(), std::nullopt);
}

TEST(CheckedSize, HasALimit) {
  EXPECT_EQ(CheckedSize(10).find(10), 10);
  EXPECT_EQ(CheckedSize(11).find(10), std::nullopt);
}

}  // namespace
}  // namespace tomofield::base
