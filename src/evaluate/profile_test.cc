#include "evaluate/profile.h"

#include <gtest/gtest.h>

#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Returns 2 x − 3 y + 5 z at the centre of each voxel. Trilinear interpolation reproduces it.
base::Volume ramp(base::Shape3 shape) {
  base::Volume volume(shape);
  for (std::int64_t z = 0; z < shape.nz; ++z)
    for (std::int64_t y = 0; y < shape.ny; ++y)
      for (std::int64_t x = 0; x < shape.nx; ++x)
        volume.at(x, y, z) = 2.0f * (static_cast<float>(x) + 0.5f) -
                             3.0f * (static_cast<float>(y) + 0.5f) +
                             5.0f * (static_cast<float>(z) + 0.5f);
  return volume;
}

TEST(Profile, KeepsARampInStepsOfOneVoxel) {
  const base::Volume volume = ramp({12, 10, 8});
  const LineSegment line{{1.0, 9.0, 2.0}, {10.0, 1.5, 7.25}};
  const auto points = line.points();
  const auto values = line_profile(volume, whole_box(volume.shape), line);
  ASSERT_EQ(points.size(), values.size());
  EXPECT_EQ(points.size(), static_cast<std::size_t>(line.length()) + 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& p = points[i];
    EXPECT_NEAR(values[i], 2.0 * p[0] - 3.0 * p[1] + 5.0 * p[2], 1e-4);
    EXPECT_NEAR((LineSegment{line.from, p}.length()), static_cast<double>(i), 1e-9);
  }
}

TEST(Profile, GoesOnBeyondTheOutermostCentres) {
  const base::Volume volume = ramp({4, 1, 1});
  const auto values =
      line_profile(volume, whole_box(volume.shape), {{0.0, 0.5, 0.0}, {4.0, 0.5, 1.0}});
  EXPECT_FLOAT_EQ(static_cast<float>(values.front()), volume.at(0, 0, 0));
  const auto along =
      line_profile(volume, whole_box(volume.shape), {{0.0, 0.5, 0.5}, {4.0, 0.5, 0.5}});
  ASSERT_EQ(along.size(), 5u);
  EXPECT_FLOAT_EQ(static_cast<float>(along.back()), volume.at(3, 0, 0));
}

TEST(Profile, CountsVoxelsOfTheWholeWhereItHasAPart) {
  const base::Volume volume = ramp({6, 6, 6});
  const base::Box part{{10, 20, 30}, {16, 26, 36}};
  const auto whole =
      line_profile(volume, whole_box(volume.shape), {{1.0, 2.0, 3.0}, {5.0, 2.0, 3.0}});
  EXPECT_EQ(line_profile(volume, part, {{11.0, 22.0, 33.0}, {15.0, 22.0, 33.0}}), whole);
  EXPECT_THROW(line_profile(volume, part, {{1.0, 2.0, 3.0}, {5.0, 2.0, 3.0}}), Error);
}

TEST(Profile, RefusesLinesOutsideOrTooShort) {
  const base::Volume volume = ramp({6, 6, 6});
  const base::Box whole = whole_box(volume.shape);
  EXPECT_THROW(line_profile(volume, whole, {{1.0, 1.0, 1.0}, {6.1, 1.0, 1.0}}), Error);
  EXPECT_THROW(line_profile(volume, whole, {{-0.1, 1.0, 1.0}, {5.0, 1.0, 1.0}}), Error);
  EXPECT_THROW(line_profile(volume, whole, {{1.0, 1.0, 1.0}, {1.5, 1.0, 1.0}}), Error);
}

TEST(Profile, TableHasDistancesInAngstrom) {
  const LineSegment line{{0.5, 0.5, 0.5}, {2.5, 0.5, 0.5}};
  EXPECT_EQ(profile_csv(line, 13.5, {{"a", {1.0, 2.0, 3.5}}, {"b", {-1.0, 0.0, 1e-9}}}),
            "distance_A,x,y,z,a,b\n"
            "0,0.5,0.5,0.5,1,-1\n"
            "13.5,1.5,0.5,0.5,2,0\n"
            "27,2.5,0.5,0.5,3.5,1e-09\n");
}

}  // namespace
}  // namespace tomofield::evaluate
