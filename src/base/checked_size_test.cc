#include "base/checked_size.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

namespace tomofield::base {
namespace {

constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();

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
