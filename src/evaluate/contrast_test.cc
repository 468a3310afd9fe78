#include "evaluate/contrast.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "random_arrays.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Holds a volume of uniform noise about 1, with denser and less noisy cubes at known places.
class ContrastTest : public ::testing::Test {
 protected:
  static constexpr base::Shape3 kShape{48, 40, 32};  // cubes of 4 voxels

  ContrastTest() : volume_(kShape) {
    volume_.data = testing::random_floats(kShape.voxels(), 1, 0.5, 1.5);
    fill(dense_, 3.0f, 0.2f);
    fill(smooth_, 1.0f, 0.05f);
  }

  void fill(const base::Box& box, float mean, float spread) {
    for (std::int64_t z = box.begin[2]; z < box.end[2]; ++z)
      for (std::int64_t y = box.begin[1]; y < box.end[1]; ++y)
        for (std::int64_t x = box.begin[0]; x < box.end[0]; ++x)
          volume_.at(x, y, z) = mean + spread * ((x + y + z) % 2 == 0 ? 1.0f : -1.0f);
  }

  base::Volume volume_;
  const base::Box dense_{{12, 20, 8}, {16, 24, 12}}, smooth_{{40, 4, 24}, {44, 8, 28}};
};

TEST_F(ContrastTest, FollowsTheFormulae) {
  const ContrastScore score = contrast_score(volume_, {{dense_}, {smooth_}});
  const double range = score.high - score.low;
  EXPECT_NEAR(score.high, 3.2, 1e-6);
  EXPECT_NEAR(score.low, 0.5, 0.01);
  EXPECT_NEAR(score.foreground_deviation, 0.2 / range, 1e-6);
  EXPECT_NEAR(score.background_mean, (1.0 - score.low) / range, 1e-6);
  EXPECT_NEAR(score.cnr, 2.0 / std::sqrt(0.5 * (0.04 + 0.0025)), 1e-5);
  EXPECT_NEAR(score.enl, std::pow((1.0 - score.low) / 0.05, 2), 1e-2);
}

TEST_F(ContrastTest, SeveralBoxesAreOneRegion) {
  const base::Box left{{12, 20, 8}, {14, 24, 12}}, right{{14, 20, 8}, {16, 24, 12}};
  EXPECT_NEAR(contrast_score(volume_, {{left, right}, {smooth_}}).cnr,
              contrast_score(volume_, {{dense_}, {smooth_}}).cnr, 1e-12);
}

TEST_F(ContrastTest, FindsTheDenseAndTheSmoothCube) {
  fill({{0, 0, 0}, {4, 4, 4}}, -4.0f, 0.01f);  // smoother still, but far from the median
  fill(dense_, 30.0f, 0.2f);
  const Regions regions = choose_regions(volume_);
  ASSERT_EQ(regions.background.size(), 1u);
  EXPECT_EQ(regions.background[0], smooth_);
  EXPECT_EQ(regions.foreground[0], dense_);
  for (float& v : volume_.data) v = 5.0f - 0.25f * v;
  EXPECT_EQ(choose_regions(volume_).foreground[0], dense_);
}

TEST_F(ContrastTest, FlatRegionsHaveInfiniteScores) {
  fill(smooth_, 1.0f, 0.0f);
  fill(dense_, 3.0f, 0.0f);
  const ContrastScore score = contrast_score(volume_, {{dense_}, {smooth_}});
  EXPECT_TRUE(std::isinf(score.cnr));
  EXPECT_TRUE(std::isinf(score.enl));
  EXPECT_EQ(contrast_score(volume_, {{smooth_}, {smooth_}}).cnr, 0.0);
}

TEST_F(ContrastTest, RefusesWhatHasNoContrast) {
  EXPECT_THROW(contrast_score(volume_, {{dense_}, {{{44, 0, 0}, {49, 4, 4}}}}), Error);
  EXPECT_THROW(contrast_score(volume_, {{{{4, 4, 4}, {4, 8, 8}}}, {smooth_}}), Error);
  EXPECT_THROW(choose_regions(base::Volume({15, 4, 4})), Error);
  EXPECT_THROW(contrast_score(base::Volume(kShape), {{dense_}, {smooth_}}), Error);
  volume_.at(1, 2, 3) = std::numeric_limits<float>::infinity();
  EXPECT_THROW(contrast_score(volume_, {{dense_}, {smooth_}}), Error);
  EXPECT_THROW(choose_regions(volume_), Error);
}

}  // namespace
}  // namespace tomofield::evaluate
