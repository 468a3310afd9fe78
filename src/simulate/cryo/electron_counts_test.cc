#include "simulate/cryo/electron_counts.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tomofield::simulate {
namespace {

TEST(ElectronCounts, InteractionConstantIsThatOfTables) {
  EXPECT_NEAR(interaction_per_VA(100.0), 9.244e-4, 1e-7);
  EXPECT_NEAR(interaction_per_VA(200.0), 7.288e-4, 1e-7);
  EXPECT_NEAR(interaction_per_VA(300.0), 6.526e-4, 1e-7);
}

TEST(ElectronCounts, IceAbsorbsMoreAtATilt) {
  const ElectronCounts counts({.dose_per_A2 = 3.0, .pixel_size_A = 10.0, .thickness_A = 1500.0});
  EXPECT_NEAR(counts.behind_ice(0.0), 300.0 * std::exp(-0.5), 1e-9);
  EXPECT_NEAR(counts.behind_ice(60.0), 300.0 * std::exp(-1.0), 1e-9);
}

TEST(ElectronCounts, DenseMatterIsDarkByTwiceItsPhase) {
  const ElectronCounts counts({.dose_per_A2 = 1.0, .pixel_size_A = 10.0, .thickness_A = 0.0});
  std::vector<float> image{0.0f, 2.0f, -2.0f, 1000.0f};  // V · pixels
  counts.expose(image, 0.0, 1.0);
  const float contrast = 2.0f * 6.526e-4f * 20.0f;
  EXPECT_FLOAT_EQ(image[0], 100.0f);
  EXPECT_NEAR(image[1], 100.0f * (1.0f - contrast), 1e-3f);
  EXPECT_NEAR(image[2], 100.0f * (1.0f + contrast), 1e-3f);
  EXPECT_EQ(image[3], 0.0f);
}

TEST(ElectronCounts, FramesArePoissonCountsThatAddUp) {
  constexpr std::int64_t kWidth = 400;
  constexpr double kMean = 150.0;
  const std::vector<float> expected(kWidth * kWidth, static_cast<float>(kMean));
  const FrameCounts counts = draw_frames(expected, kWidth, 7, 1000);
  const auto n = static_cast<double>(expected.size());
  double all = 0.0, variance = 0.0, even = 0.0, covariance = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(counts.all[i], counts.even[i] + counts.odd[i]);
    const double e = static_cast<double>(counts.even[i]) - kMean / 2.0;
    const double o = static_cast<double>(counts.odd[i]) - kMean / 2.0;
    all += (e + o) / n;
    even += e / n;
    variance += (e + o) * (e + o) / n;
    covariance += e * o / n;
  }
  // Four standard errors.
  EXPECT_NEAR(all, 0.0, 4.0 * std::sqrt(kMean / n));
  EXPECT_NEAR(even, 0.0, 4.0 * std::sqrt(kMean / 2.0 / n));
  EXPECT_NEAR(variance / kMean, 1.0, 4.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(covariance / (kMean / 2.0), 0.0, 4.0 / std::sqrt(n));
}

}  // namespace
}  // namespace tomofield::simulate
