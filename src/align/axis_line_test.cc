#include "align/axis_line.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tomofield::align {
namespace {

TEST(AxisLine, FindsTheLowestPlaceOfAParabolaFarAway) {
  int count = 0;
  AxisLine line([&](double axis_deg) {
    ++count;
    return std::pow(axis_deg - 2.3, 2) + 5.0;
  });
  const double place = line.descend(0.0, 1.0, 3.0);
  EXPECT_EQ(place, 2.0);
  EXPECT_NEAR(line.lowest(place, 1.0), 2.3, 1e-12);
  EXPECT_EQ(count, 5);  // from -1 to 3: each place is looked at once
}

TEST(AxisLine, StaysWithinItsRange) {
  AxisLine line([](double axis_deg) { return axis_deg; });
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), -3.0);
}

TEST(AxisLine, StaysWhereTheResidualDoesNotChange) {
  AxisLine line([](double) { return 1.0; });
  EXPECT_EQ(line.descend(0.0, 1.0, 3.0), 0.0);
  EXPECT_EQ(line.lowest(0.0, 1.0), 0.0);
}

}  // namespace
}  // namespace tomofield::align
