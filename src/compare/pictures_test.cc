#include "compare/pictures.h"

#include <gtest/gtest.h>

namespace tomofield::compare {
namespace {

// Returns a flat plane with a checkerboard from column and row 60 on.
report::Slice plane_with_texture() {
  report::Slice plane(128, 96);
  for (std::int64_t y = 60; y < 90; ++y) {
    for (std::int64_t x = 60; x < 90; ++x) plane.row(y)[x] = static_cast<float>((x + y) % 2);
  }
  return plane;
}

TEST(BusiestDetail, LiesWhereThePlaneVariesMost) {
  const Rectangle detail = busiest_detail(plane_with_texture());
  EXPECT_EQ(detail.x1 - detail.x0, 32);
  EXPECT_EQ(detail.y1 - detail.y0, 32);
  EXPECT_EQ(detail.x0, 64);
  EXPECT_EQ(detail.y0, 64);
}

TEST(BusiestDetail, FitsIntoSmallPlanes) {
  const Rectangle detail = busiest_detail(report::Slice(20, 9));
  EXPECT_EQ(detail.x1, 9);
  EXPECT_EQ(detail.y1, 9);
}

TEST(LineThrough, RunsThroughTheMiddlesOfVoxels) {
  const evaluate::LineSegment line = line_through({62, 60, 66, 70}, 9);
  EXPECT_EQ(line.from, (std::array{62.5, 65.5, 4.5}));
  EXPECT_EQ(line.to, (std::array{65.5, 65.5, 4.5}));
  EXPECT_EQ(line.points().size(), 4u);
}

}  // namespace
}  // namespace tomofield::compare
