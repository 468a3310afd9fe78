#include "align/start/exposures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "sphere_series.h"

namespace tomofield::alignment {
namespace {

// Returns what exposures_differ() says of views whose gains jump by a part of 1.
bool differ(double jump) {
  std::vector<double> gains;
  for (int view = 0; view < 31; ++view) gains.push_back(1.0 + (view % 2 == 0 ? jump : -jump));
  const testing::SphereSeries series({.noise_sigma = 0.1, .scale_of_view = gains});
  const measurement::Measurement measurement{
      .geometry = series.geometry,
      .roi = {0, 0, testing::SphereSeries::kWidth, testing::SphereSeries::kRows},
      .rays = series.rays,
      .noise_sigma = series.noise_sigma,
      .mean_density = 0.1};
  return exposures_differ(measurement, distributed::Communicator::alone());
}

TEST(ExposuresDiffer, IfTheMeansOfViewsJump) {
  EXPECT_FALSE(differ(0.0));
  EXPECT_FALSE(differ(0.02));
  EXPECT_TRUE(differ(0.5));
}

}  // namespace
}  // namespace tomofield::alignment
