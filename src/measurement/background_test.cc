#include "measurement/background.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sphere_series.h"

namespace tomofield::measurement {
namespace {

using testing::SphereSeries;

TEST(Background, IsSubtractedFromTheRaysThatCount) {
  const SphereSeries series;
  Measurement measured{.geometry = series.geometry,
                       .roi = {0, 0, SphereSeries::kWidth, SphereSeries::kRows},
                       .rays = series.rays,
                       .noise_sigma = series.noise_sigma,
                       .mean_density = 0.1,
                       .background = 4.0};
  const Measurement rest = without_background(0.25, measured);
  EXPECT_EQ(rest.background, 3.0);
  EXPECT_EQ(measured.background, 4.0);
  int num_counting = 0;
  for (int view = 0; view < series.geometry.num_views(); ++view) {
    for (std::int64_t x = 0; x < SphereSeries::kWidth; ++x) {
      const float taken = measured.rays->counts(view, x, 5) ? 1.0f : 0.0f;
      EXPECT_EQ(rest.rays->ray(view, x, 5), measured.rays->ray(view, x, 5) - taken);
      num_counting += taken > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(num_counting, 0);
  // A slab of constant density d has the brightness d · thickness / cos(tilt).
  double cosines = 0;
  for (int view = 0; view < series.geometry.num_views(); ++view)
    cosines += series.geometry.cos_tilt(view) / series.geometry.num_views();
  EXPECT_NEAR(rest.mean_density, 0.1 - cosines / series.geometry.thickness, 1e-12);
}

}  // namespace
}  // namespace tomofield::measurement
