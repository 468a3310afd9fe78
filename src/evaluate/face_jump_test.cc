#include "evaluate/face_jump.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace tomofield::evaluate {
namespace {

using enum field::Region;
using enum PairPlace;

// Returns two leaves of 32 px beside each other; the second is split into four.
field::Quadtree split_tree() {
  field::Quadtree tree({.x0 = 8, .y0 = -4, .cell_size = 32, .columns = 2, .rows = 1},
                       {kInterest, kInterest});
  tree.split(1);
  return tree;
}

// A volume that rises by `inside` from voxel to voxel along x and y, and by `across` more at faces.
base::Volume steps(const LeafFaces& faces, float inside, float across) {
  const Rectangle& region = faces.region();
  base::Volume volume({region.width(), region.height(), 3});
  for (std::int64_t z = 0; z < 3; ++z) {
    for (std::int64_t y = 0; y < volume.shape.ny; ++y) {
      for (std::int64_t x = 0; x < volume.shape.nx; ++x) {
        float value = static_cast<float>(z) + inside * static_cast<float>(x + y);
        if (region.x0 + x >= 40) value += across;  // the face between both roots
        volume.at(x, y, z) = value;
      }
    }
  }
  return volume;
}

TEST(FaceJump, FacesAreThoseOfTheLeavesInARegion) {
  const field::Quadtree tree = split_tree();  // faces at x = 40, at x = 56 and at y = 12
  const LeafFaces faces(tree, {10, 0, 70, 28});
  std::vector<PairPlace> row(59, kElsewhere), next(60, kElsewhere);
  std::fill(row.begin() + 40 - 10 - 9, row.begin() + 56 - 10 + 8, kNearFace);
  row[40 - 10 - 1] = row[56 - 10 - 1] = kAcrossFace;
  EXPECT_EQ(faces.pairs_along_x(0), row);
  EXPECT_EQ(faces.pairs_along_y(0), next);
  std::fill(next.begin() + 40 - 10, next.end(), kNearFace);
  EXPECT_EQ(faces.pairs_along_y(3), next);
  EXPECT_EQ(faces.pairs_along_y(19), next);
  std::fill(next.begin() + 40 - 10, next.end(), kAcrossFace);
  EXPECT_EQ(faces.pairs_along_y(11), next);
}

TEST(FaceJump, DoesNotDependOnVoxelsFarFromFaces) {
  const field::Quadtree tree = split_tree();
  const LeafFaces faces(tree, {8, -4, 72, 28});
  base::Volume volume = steps(faces, 0.5f, 0.0f);
  const double before = face_jump(volume, faces)->both;
  volume.at(10, 10, 1) += 100.0f;  // 22 voxels from the nearest face
  EXPECT_EQ(face_jump(volume, faces)->both, before);
  volume.at(25, 10, 1) += 100.0f;
  EXPECT_LT(face_jump(volume, faces)->both, before);
}

TEST(FaceJump, IsTheMeanAcrossOverTheMeanNearFaces) {
  const field::Quadtree tree = split_tree();
  const LeafFaces faces(tree, {8, -4, 72, 28});
  const auto even = face_jump(steps(faces, 0.5f, 0.0f), faces);
  ASSERT_TRUE(even && even->x && even->y);
  EXPECT_DOUBLE_EQ(even->both, 1.0);
  EXPECT_DOUBLE_EQ(*even->x, 1.0);
  EXPECT_DOUBLE_EQ(*even->y, 1.0);
  // The first of two faces along x is three times as high. Along y nothing changes.
  const auto uneven = face_jump(steps(faces, 0.5f, 1.0f), faces);
  EXPECT_DOUBLE_EQ(*uneven->x, 2.0);
  EXPECT_DOUBLE_EQ(*uneven->y, 1.0);
  EXPECT_DOUBLE_EQ(uneven->both, (2 * 32 * 2.0 + 32 * 1.0) / (3 * 32));
}

TEST(FaceJump, IsNothingWithoutFaces) {
  const field::Quadtree one({.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 1, .rows = 1},
                            {kInterest});
  const LeafFaces inside(one, {0, 0, 20, 20});
  EXPECT_EQ(face_jump(steps(inside, 1.0f, 0.0f), inside).has_value(), false);
  const field::Quadtree tree = split_tree();
  const LeafFaces row(tree, {20, 0, 50, 8});  // crosses one face along x, none along y
  const auto jump = face_jump(steps(row, 1.0f, 0.0f), row);
  EXPECT_TRUE(jump && jump->x && !jump->y);
}

}  // namespace
}  // namespace tomofield::evaluate
