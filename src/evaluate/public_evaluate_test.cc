#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "expect_parts.h"
#include "tomofield/error.h"
#include "tomofield/evaluate.h"
#include "warning_catcher.h"

namespace tomofield {
namespace {

// Noise between 0 and 1.
Tomogram noise(std::uint64_t seed) {
  Tomogram tomogram{.size = {16, 12, 10}, .voxel_size_A = 4.0, .values = {}};
  base::Random random(seed);
  for (int i = 0; i < 16 * 12 * 10; ++i)
    tomogram.values.push_back(static_cast<float>(random.uniform()));
  return tomogram;
}

TEST(PublicEvaluate, ScoresBeforeAndAfterScaleAndOffset) {
  Tomogram truth = noise(1);
  truth.values.front() = 0.0f;
  truth.values.back() = 1.0f;
  Tomogram volume = truth;
  for (float& value : volume.values) value = 0.5f * value + 0.25f;
  const VolumeScores scores = score_volume(volume, truth);
  EXPECT_EQ(scores.peak, 1.0);
  double squares = 0;
  for (std::size_t i = 0; i < truth.values.size(); ++i)
    squares += std::pow(double{volume.values[i]} - double{truth.values[i]}, 2);
  EXPECT_NEAR(scores.psnr_raw_dB,
              -10 * std::log10(squares / static_cast<double>(truth.values.size())), 1e-9);
  EXPECT_NEAR(scores.scale, 2.0, 1e-5);
  EXPECT_NEAR(scores.offset, -0.5, 1e-5);
  EXPECT_NEAR(scores.correlation, 1.0, 1e-6);
  EXPECT_GT(scores.psnr_affine_dB, 100.0);
  EXPECT_LT(scores.ssim_raw, 0.99);
  EXPECT_NEAR(scores.ssim_affine, 1.0, 1e-6);
}

TEST(PublicEvaluate, ShellsOfEqualVolumesCorrelate) {
  const Tomogram volume = noise(1), other = noise(2);
  const ShellCorrelation same = correlate_shells(volume, volume);
  ASSERT_EQ(same.frequency_per_A.size(), 8u);
  EXPECT_NEAR(same.frequency_per_A.back(), 1.0 / 8.0, 1e-12);  // Nyquist
  for (const double value : same.correlation) EXPECT_NEAR(value, 1.0, 1e-6);
  EXPECT_EQ(resolution_A(same), std::nullopt);

  // Low frequencies alike, high ones independent: the curve falls in between.
  Tomogram first = noise(3), second = noise(4);
  for (std::size_t i = 0; i < first.values.size(); ++i) {
    const float wave =
        5 * static_cast<float>(std::cos(2 * std::numbers::pi * static_cast<double>(i % 16) / 16));
    first.values[i] += wave;
    second.values[i] += wave;
  }
  const auto resolution = resolution_A(correlate_shells(first, second), 0.5);
  ASSERT_TRUE(resolution);
  EXPECT_GT(*resolution, 8.0);
  EXPECT_LT(*resolution, 64.0);
}

TEST(PublicEvaluate, RefusesVolumesThatCannotBeCompared) {
  const Tomogram volume = noise(1);
  Tomogram other = noise(2);
  other.size = {12, 16, 10};
  EXPECT_THROW(score_volume(volume, other), Error);
  EXPECT_THROW(correlate_shells(volume, other), Error);
  other.size = {16, 12, 11};
  EXPECT_THROW(score_volume(other, volume), Error);
  other = noise(2);
  other.values[7] = std::nanf("");
  EXPECT_THROW(score_volume(volume, other), Error);
  other = noise(2);
  other.voxel_size_A = 8.0;
  EXPECT_THROW(score_volume(volume, other), Error);
  EXPECT_THROW(correlate_shells(volume, other), Error);
  // A size that is not known is that of the other volume.
  for (const double unknown_A : {0.0, 1.0}) {
    other.voxel_size_A = unknown_A;
    const testing::WarningCatcher caught;
    EXPECT_EQ(correlate_shells(volume, other).frequency_per_A,
              correlate_shells(volume, volume).frequency_per_A);
    EXPECT_NO_THROW(score_volume(volume, other));
    testing::expect_parts(caught.text(), {"voxel sizes differ"});
  }
  Tomogram bare = volume;
  bare.voxel_size_A = other.voxel_size_A = 0.0;
  EXPECT_THROW(correlate_shells(bare, other), Error);
}

}  // namespace
}  // namespace tomofield
