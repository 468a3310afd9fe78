#include "base/percentile.h"

#include <gtest/gtest.h>

#include <vector>

namespace tomofield::base {
namespace {

TEST(Percentile, InterpolatesLikeNumpy) {
  const std::vector<float> values{5.0f, 1.0f, 4.0f, 2.0f};
  EXPECT_DOUBLE_EQ(percentile(values, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(percentile(values, 50.0), 3.0);
  EXPECT_DOUBLE_EQ(percentile(values, 90.0), 4.7);
  EXPECT_DOUBLE_EQ(percentile(values, 100.0), 5.0);
}

}  // namespace
}  // namespace tomofield::base
