#include "base/statistics.h"

#include <gtest/gtest.h>

#include <vector>

namespace tomofield::base {
namespace {

TEST(Statistics, PercentilesInterpolatesLikeNumpy) {
  const std::vector<float> values{5.0f, 1.0f, 4.0f, 2.0f};
  EXPECT_DOUBLE_EQ(percentile(values, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(percentile(values, 50.0), 3.0);
  EXPECT_DOUBLE_EQ(percentile(values, 90.0), 4.7);
  EXPECT_DOUBLE_EQ(percentile(values, 100.0), 5.0);
}

TEST(Statistics, MedianIsTheUpperOneOfTwoInTheMiddle) {
  std::vector<float> odd = {5, 1, 3}, even = {4, 1, 3, 2}, none;
  EXPECT_EQ(median_in_place(odd), 3.0f);
  EXPECT_EQ(median_in_place(even), 3.0f);
  EXPECT_EQ(median_in_place(none), 0.0f);
}

TEST(Statistics, OutliersHardlyChangeTheRobustDeviation) {
  std::vector<float> values = {-2, -1, 0, 1, 2}, with_outlier = {-2, -1, 0, 1, 1000};
  EXPECT_DOUBLE_EQ(robust_deviation_in_place(values), 1.4826);
  EXPECT_DOUBLE_EQ(robust_deviation_in_place(with_outlier), 1.4826);
}

}  // namespace
}  // namespace tomofield::base
