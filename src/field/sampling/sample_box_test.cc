#include "field/sampling/sample_box.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "random_arrays.h"
#include "tomofield/error.h"
#include "uneven_model.h"

namespace tomofield::field {
namespace {

using testing::uneven_model;

std::size_t index(const OrientedBox& box, std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<std::size_t>((z * box.size[1] + y) * box.size[0] + x);
}

// Computes the densities at the voxels' centres, one by one.
std::vector<double> point_by_point(const Field& field, const OrientedBox& box) {
  std::vector<double> expected;
  for (std::int64_t z = 0; z < box.size[2]; ++z) {
    for (std::int64_t y = 0; y < box.size[1]; ++y) {
      for (std::int64_t x = 0; x < box.size[0]; ++x) {
        const Point at = box.position({static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                                       static_cast<double>(z) + 0.5});
        expected.push_back(field.density(at[0], at[1], at[2]));
      }
    }
  }
  return expected;
}

class EachBoxedField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachBoxedField, ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

TEST_P(EachBoxedField, AlignedBoxesAreTheDensity) {
  const auto model = uneven_model(GetParam());
  const std::vector<OrientedBox> boxes = {
      box_between({10, 4, 0}, {110, 120, 21.5}, 1.0),                         // the region
      {.centre_px = {30.3, 41.7, 9.1}, .size = {37, 35, 11}, .voxel_px = 1},  // across leaves
      {.centre_px = {20, 30, 10}, .size = {33, 50, 7}, .voxel_px = 0.37},     // finer than pixels
      {.centre_px = {-60, 4, 21}, .size = {21, 19, 9}, .voxel_px = 1},        // over a corner
      {.centre_px = {500, 4, 21}, .size = {3, 4, 5}, .voxel_px = 1},          // outside
      {.centre_px = {40, 40, 10}, .size = {1, 1, 1}, .voxel_px = 1},
  };
  for (const OrientedBox& box : boxes)
    testing::expect_near(sample_box(*model.field, box), point_by_point(*model.field, box), 3e-6);
}

TEST_P(EachBoxedField, OutsideTheDomainThereIsNothing) {
  const auto model = uneven_model(GetParam());
  const OrientedBox box{.centre_px = {-60, 4, 0}, .size = {6, 6, 6}, .voxel_px = 1};
  const auto values = sample_box(*model.field, box);
  EXPECT_EQ(std::count(values.begin(), values.end(), 0.0f), 6 * 6 * 6 - 3 * 3 * 3);
  EXPECT_GT(values.back(), 0.0f);
}

// Voxels of one point, most of them beside the domain, and coarse ones that reach into it.
TEST_P(EachBoxedField, TurnedBoxesAreTheDensity) {
  const auto model = uneven_model(GetParam());
  OrientedBox box{.centre_px = {-60, 20, 5},
                  .size = {20, 21, 22},
                  .voxel_px = 3,
                  .field_from_box = rotation_from_euler(10, 70, 30)};
  OrientedBox points = box;
  points.voxel_px = 1;
  for (std::int64_t& side : points.size) side *= 3;
  const std::vector<double> densities = point_by_point(*model.field, points);
  testing::expect_near(sample_box(*model.field, points), densities, 3e-6);
  std::vector<double> means;
  for (std::int64_t i = 0; i < box.size[0] * box.size[1] * box.size[2]; ++i) {
    const std::int64_t x = i % box.size[0], y = i / box.size[0] % box.size[1];
    const std::int64_t z = i / box.size[0] / box.size[1];
    double sum = 0.0;
    for (int p = 0; p < 27; ++p)
      sum += densities[index(points, 3 * x + p % 3, 3 * y + p / 3 % 3, 3 * z + p / 9)];
    means.push_back(sum / 27);
  }
  OrientedBox fine{.centre_px = {-60, 4, 5},  // a corner of the domain
                   .size = {20, 20, 10},
                   .voxel_px = 0.1,
                   .field_from_box = rotation_from_euler(90, 0, 0)};
  testing::expect_near(sample_box(*model.field, fine), point_by_point(*model.field, fine), 3e-6);
  fine.centre_px = {196, 132, 20};  // the opposite one
  testing::expect_near(sample_box(*model.field, fine), point_by_point(*model.field, fine), 3e-6);
  EXPECT_GT(std::ranges::count(means, 0.0), std::ssize(means) / 2);
  EXPECT_LT(std::ranges::count(means, 0.0), std::ssize(means));
  testing::expect_near(sample_box(*model.field, box), means, 3e-6);
}

// A voxel of f pixels is the mean of f³ voxels of one pixel. A voxel of 2.5 px has three points
// along each axis.
TEST_P(EachBoxedField, CoarseVoxelsAreMeansOfFineOnes) {
  const auto model = uneven_model(GetParam());
  for (const double voxel_px : {2.0, 2.5, 20.0}) {
    OrientedBox coarse{.centre_px = {31.2, 35.2, 12.0}, .size = {9, 7, 4}, .voxel_px = voxel_px};
    if (voxel_px == 20.0) coarse.size = {2, 3, 1};
    const std::int64_t factor = points_per_voxel(coarse);
    ASSERT_EQ(factor, static_cast<std::int64_t>(std::ceil(voxel_px)));
    OrientedBox fine = coarse;
    for (auto& n : fine.size) n *= factor;
    fine.voxel_px = voxel_px / static_cast<double>(factor);
    const auto fine_values = sample_box(*model.field, fine);
    std::vector<double> expected(
        static_cast<std::size_t>(coarse.size[0] * coarse.size[1] * coarse.size[2]));
    for (std::int64_t z = 0; z < fine.size[2]; ++z) {
      for (std::int64_t y = 0; y < fine.size[1]; ++y) {
        for (std::int64_t x = 0; x < fine.size[0]; ++x) {
          expected[index(coarse, x / factor, y / factor, z / factor)] +=
              static_cast<double>(fine_values[index(fine, x, y, z)]) /
              static_cast<double>(factor * factor * factor);
        }
      }
    }
    testing::expect_near(sample_box(*model.field, coarse), expected, 3e-6);
    // A rotation by a full turn takes the other code path.
    OrientedBox turned = coarse;
    turned.field_from_box = rotation_from_euler(90, 0, 270);
    ASSERT_FALSE(turned.is_aligned());
    testing::expect_near(sample_box(*model.field, turned), expected, 3e-6);
  }
}

TEST_P(EachBoxedField, QuarterTurnsPermuteTheVolume) {
  const auto model = uneven_model(GetParam());
  const OrientedBox box{.centre_px = {33.0, 35.0, 10.0}, .size = {13, 15, 11}, .voxel_px = 1.0};
  const auto straight = sample_box(*model.field, box);
  // Rotate about z: field = R · box takes the box's x to the field's −y (RELION's rot is passive).
  OrientedBox turned = box;
  turned.size = {15, 13, 11};
  turned.field_from_box = rotation_from_euler(90, 0, 0);
  auto values = sample_box(*model.field, turned);
  for (std::int64_t z = 0; z < 11; ++z) {
    for (std::int64_t y = 0; y < 13; ++y) {
      for (std::int64_t x = 0; x < 15; ++x)
        EXPECT_NEAR(values[index(turned, x, y, z)], straight[index(box, y, 14 - x, z)], 3e-6);
    }
  }
  // Rotate about y: the box's x goes to the field's z.
  turned.size = {11, 15, 13};
  turned.field_from_box = rotation_from_euler(0, 90, 0);
  values = sample_box(*model.field, turned);
  for (std::int64_t z = 0; z < 13; ++z) {
    for (std::int64_t y = 0; y < 15; ++y) {
      for (std::int64_t x = 0; x < 11; ++x)
        EXPECT_NEAR(values[index(turned, x, y, z)], straight[index(box, 12 - z, y, x)], 3e-6);
    }
  }
}

TEST(SampleBox, EulerAnglesAreRelions) {
  // The third row is the direction with polar angles (rot, tilt); psi turns about it.
  const Rotation r = rotation_from_euler(30, 40, 50);
  const double degree = std::acos(-1.0) / 180.0;
  EXPECT_NEAR(r[2][0], std::sin(40 * degree) * std::cos(30 * degree), 1e-12);
  EXPECT_NEAR(r[2][1], std::sin(40 * degree) * std::sin(30 * degree), 1e-12);
  EXPECT_NEAR(r[2][2], std::cos(40 * degree), 1e-12);
  EXPECT_NEAR(r[0][2], -std::sin(40 * degree) * std::cos(50 * degree), 1e-12);
  EXPECT_NEAR(r[1][2], std::sin(40 * degree) * std::sin(50 * degree), 1e-12);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double product = 0.0;
      for (std::size_t k = 0; k < 3; ++k) product += r[i][k] * r[j][k];
      EXPECT_NEAR(product, i == j ? 1.0 : 0.0, 1e-12);
    }
  }
  EXPECT_EQ(rotation_from_euler(0, 0, 0), kNoRotation);
}

TEST(SampleBox, AnglesThatTurnNothingAreRefused) {
  EXPECT_NO_THROW(rotation_from_euler(-720, 90, 1e4));
  for (const double bad : {1e300, -1e6, std::nan(""), HUGE_VAL})
    EXPECT_THROW(rotation_from_euler(0, bad, 0), Error) << bad;
}

TEST(SampleBox, BoxesFillTheirCornersWithWholeVoxels) {
  const OrientedBox box = box_between({10, 4, 0}, {110, 121, 21.5}, 2.0);
  EXPECT_EQ(box.size, (std::array<std::int64_t, 3>{50, 58, 10}));
  EXPECT_EQ(box.centre_px, (Point{60, 62.5, 10.75}));
  EXPECT_EQ(box.position({0, 0, 0}), (Point{10, 4.5, 0.75}));
  EXPECT_EQ(box_between({0, 0, 0}, {3, 3, 0.3}, 0.1).size,
            (std::array<std::int64_t, 3>{30, 30, 3}));
  EXPECT_EQ(box_between({0, 0, 0}, {3, 3, 3}, 5).size, (std::array<std::int64_t, 3>{1, 1, 1}));
  for (const double tiny : {1e-9, 1e-30, 1e-300})
    EXPECT_THROW(box_between({0, 0, 0}, {3, 3, 3}, tiny), Error);
}

TEST(SampleBox, BoxesThatNoMachineSamplesAreRefused) {
  const auto refuses = [](std::array<std::int64_t, 3> size, double voxel_px) {
    try {
      require_feasible({.size = size, .voxel_px = voxel_px});
      return false;
    } catch (const Error&) {
      return true;
    }
  };
  constexpr std::int64_t k1 = 1;
  EXPECT_TRUE(refuses({k1 << 21, k1 << 21, k1 << 22}, 1));  // 2⁶⁴ voxels
  EXPECT_TRUE(refuses({k1 << 62, 4, 4}, 1));
  EXPECT_TRUE(refuses({4, 1, k1 << 62}, 1));
  EXPECT_TRUE(refuses({k1 << 31, 1, 1}, 1));
  EXPECT_TRUE(refuses({2, 2, kMostVoxelsAlongAxis + 1}, 1));
  EXPECT_FALSE(refuses({2, 2, kMostVoxelsAlongAxis}, 1));
  EXPECT_TRUE(refuses({8, 8, 8}, 1e300));
  EXPECT_TRUE(refuses({8, 8, 8}, 1e9));
  EXPECT_FALSE(refuses({4096, 4096, 1024}, 1));
  EXPECT_FALSE(refuses({1, 1, 1}, 4096));
}

TEST(SampleBox, PartsCoverTheBoxOnceOnAnyNumberOfThreads) {
  const auto model = uneven_model(FieldKind::kVm);
  const OrientedBox box{.centre_px = {30, 35, 10}, .size = {20, 37, 23}, .voxel_px = 1.0};
  const int threads = base::thread_count();
  std::vector<std::vector<float>> results;
  for (const int count : {1, 3}) {
    base::set_thread_count(count);
    std::vector<std::atomic<int>> visits(37 * 23);
    sample_box(*model.field, box, [&](const BoxPart& part) {
      EXPECT_EQ(part.values.size(),
                static_cast<std::size_t>(part.num_sections * part.num_rows * 20));
      for (std::int64_t s = 0; s < part.num_sections; ++s) {
        for (std::int64_t r = 0; r < part.num_rows; ++r)
          ++visits[static_cast<std::size_t>((part.first_section + s) * 37 + part.first_row + r)];
      }
    });
    EXPECT_TRUE(std::all_of(visits.begin(), visits.end(), [](const auto& n) { return n == 1; }));
    results.push_back(sample_box(*model.field, box));
  }
  base::set_thread_count(threads);
  EXPECT_EQ(results[0], results[1]);
}

}  // namespace
}  // namespace tomofield::field
