#include "evaluate/reprojection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/threads/parallel.h"
#include "random_arrays.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Holds a volume on a part of views that are 60 wide and 30 high. It does not change along x and z,
// so rays that stay in it see value(y) · thickness / cos θ.
class ReprojectionTest : public ::testing::Test {
 protected:
  static constexpr std::int64_t kWidth = 60, kHeight = 30, kThickness = 8;
  const Rectangle roi_{10, 4, 54, 26};

  ReprojectionTest() : volume_({roi_.width(), roi_.height(), kThickness}) {
    values_ = testing::random_floats(kHeight, 1, 1.0, 2.0);
    for (std::int64_t z = 0; z < kThickness; ++z)
      for (std::int64_t y = 0; y < roi_.height(); ++y)
        for (std::int64_t x = 0; x < roi_.width(); ++x)
          volume_.at(x, y, z) = values_[static_cast<std::size_t>(y + roi_.y0)];
  }

  VolumePlace place(std::vector<double> tilts) const {
    return {geometry::centred_geometry(kWidth, kHeight, kThickness, std::move(tilts)), roi_};
  }

  // Computes the errors of views that measure 3 · line integral − 7 where a ray is in the volume
  // all the way and not within a voxel of its faces, and `elsewhere` on the other rays.
  measurement::ViewErrors errors(const VolumePlace& place, float elsewhere) const {
    const std::size_t views = place.geometry.tilt_deg.size();
    const measurement::SlabViews measured(
        {views, kWidth, kHeight, roi_.y0, roi_.height()}, 1.0,
        [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
          const double angle = place.geometry.tilt_deg[view] * std::numbers::pi / 180.0;
          for (std::int64_t y = 0; y < kHeight; ++y)
            for (std::int64_t x = 0; x < kWidth; ++x) {
              const auto i = static_cast<std::size_t>(y * kWidth + x);
              // x − 30 = (X − 30) cos θ + (Z − 4) sin θ, for Z = −½ and 8½
              const double middle = 30.0 + (static_cast<double>(x) + 0.5 - 30.0) / std::cos(angle);
              const double reach = 4.5 * std::abs(std::tan(angle));
              const bool inside = middle - reach >= 10.5 && middle + reach <= 53.5;
              valid[i] = 1;
              image[i] = inside ? 3.0f * values_[static_cast<std::size_t>(y)] * kThickness /
                                          static_cast<float>(std::cos(angle)) -
                                      7.0f
                                : elsewhere;
              if (x == 30 && y % 3 == 0) {
                valid[i] = 0;
                image[i] = 0.0f;
              }
            }
        },
        ".");
    const std::vector<double> weight(views, 4.0);
    std::vector<int> all;
    for (std::size_t v = 0; v < views; ++v) all.push_back(static_cast<int>(v));
    return reprojection_errors(volume_, place, measured, all, weight);
  }

  base::Volume volume_;
  std::vector<float> values_;
};

TEST_F(ReprojectionTest, FindsScaleAndOffsetFromRaysThatStayInside) {
  const measurement::ViewErrors flat = errors(place({-44.0, -20.0, 0.0, 35.0}), 1e4f);
  for (std::size_t v = 0; v < flat.views.size(); ++v) {
    EXPECT_NEAR(flat.models[v].scale, 3.0, 1e-3) << v;
    EXPECT_NEAR(flat.models[v].offset, -7.0, 2e-2) << v;
    EXPECT_LT(flat.view_error[v], 1e-5) << v;
  }
  // Steep rays step along x and meet the faces across z between samples: the ripple is 1 %.
  const measurement::ViewErrors steep = errors(place({-60.0, 50.0}), 1e4f);
  for (std::size_t v = 0; v < steep.views.size(); ++v) {
    EXPECT_NEAR(steep.models[v].scale, 3.0, 0.03) << v;
    EXPECT_LT(steep.view_error[v], 4.0 * 0.01 * 0.01 * 96.0 * 96.0) << v;
  }
}

TEST_F(ReprojectionTest, CountsEveryRayOfAWholeSpecimen) {
  // The views beside the volume show −7, the offset, and nothing else.
  VolumePlace whole = place({0.0});
  whole.is_whole_specimen = true;
  EXPECT_LT(errors(whole, -7.0f).total, 1e-5);
  EXPECT_GT(errors(whole, 5.0f).total, 1.0);
  EXPECT_LT(errors(place({0.0}), 5.0f).total, 1e-5);
}

TEST_F(ReprojectionTest, IsTheSameForAnyNumberOfThreads) {
  for (float& v : volume_.data) v *= v;
  const int threads = base::thread_count();
  base::set_thread_count(1);
  const double one = errors(place({-40.0, 10.0}), 0.0f).total;
  base::set_thread_count(3);
  const double three = errors(place({-40.0, 10.0}), 0.0f).total;
  base::set_thread_count(threads);
  EXPECT_GT(one, 0.0);
  EXPECT_EQ(one, three);
}

TEST_F(ReprojectionTest, RefusesAViewWhoseRaysAllLeaveTheVolume) {
  EXPECT_THROW(errors(place({0.0, 79.9}), 0.0f), Error);
}

}  // namespace
}  // namespace tomofield::evaluate
