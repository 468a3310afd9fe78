#include "align/start/slab_pose_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "base/random.h"
#include "gaussian_scene.h"

namespace tomofield::alignment {
namespace {

constexpr std::int64_t kSize = 64;
constexpr double kThickness = 30;

// Returns the pose that views of an extended slab tell whose tilt angles are given with an error.
std::optional<FoundPose> find_pose(double given_thickness, double tilt_error_deg, int hand = 1) {
  const testing::GaussianScene scene(500, {95, 40, kThickness / 2});
  base::Random random(3);
  std::vector<double> given_deg;
  for (double tilt = -60; tilt <= 60; tilt += 6) given_deg.push_back(tilt + tilt_error_deg);
  SlabPoseSearch search(given_deg, hand, kSize, false);
  for (std::size_t view = 0; view < given_deg.size(); ++view) {
    std::vector<float> image;
    for (std::int64_t i = 0; i < kSize * kSize; ++i) {
      const double x = static_cast<double>(i % kSize) + 0.5 - kSize / 2.0;
      const double y = static_cast<double>(i / kSize) + 0.5 - kSize / 2.0;
      const double shown = scene.projection(x, y, hand * (given_deg[view] - tilt_error_deg));
      image.push_back(static_cast<float>(shown + 0.1 * random.normal()));
    }
    image[17] = std::nanf("");
    const std::vector<float> predicted(image.size(), 0.0f);
    search.add(view, {.width = kSize, .height = kSize, .measured = image, .predicted = predicted});
  }
  return search.find({.thickness_px = given_thickness});
}

TEST(SlabPoseSearch, FindsThicknessAndPitch) {
  for (const double error_deg : {0.0, 6.0, -6.0}) {
    const auto found = find_pose(36, error_deg);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->pose.pitch_deg, -error_deg, 1.5);
    EXPECT_NEAR(found->pose.thickness_px, kThickness, 0.25 * kThickness);
    EXPECT_GT(found->error.pitch_deg, 0.0);
    EXPECT_LT(found->error.pitch_deg, 3.0);
  }
}

TEST(SlabPoseSearch, TheHandTurnsThePitchWithTheTilts) {
  const auto found = find_pose(30, 6.0, -1);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->pose.pitch_deg, -6.0, 1.5);
}

TEST(SlabPoseSearch, LowImagesTellNothing) {
  SlabPoseSearch search(std::vector<double>{-10, 0, 10}, 1, kSize, false);
  const std::vector<float> image(kSize * 30, 1.0f);
  for (std::size_t view = 0; view < 3; ++view)
    search.add(view, {.width = kSize, .height = 30, .measured = image, .predicted = image});
  EXPECT_FALSE(search.find({.thickness_px = 20}));
}

}  // namespace
}  // namespace tomofield::alignment
