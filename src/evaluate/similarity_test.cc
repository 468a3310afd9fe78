#include "evaluate/similarity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

base::Volume random_volume(base::Shape3 shape, std::uint64_t seed) {
  base::Volume volume(shape);
  base::Random random(seed);
  for (float& v : volume.data) v = static_cast<float>(random.uniform());
  return volume;
}

/// Computes the mean SSIM window by window, straight from the definition.
double plain_ssim(const base::Volume& x, const base::Volume& y, double peak) {
  const double c1 = 1e-4 * peak * peak, c2 = 9e-4 * peak * peak;
  double sum = 0.0;
  int windows = 0;
  for (std::int64_t z0 = 0; z0 + 7 <= x.shape.nz; ++z0) {
    for (std::int64_t y0 = 0; y0 + 7 <= x.shape.ny; ++y0) {
      for (std::int64_t x0 = 0; x0 + 7 <= x.shape.nx; ++x0) {
        const auto each = [&](auto&& visit) {
          for (std::int64_t k = z0; k < z0 + 7; ++k)
            for (std::int64_t j = y0; j < y0 + 7; ++j)
              for (std::int64_t i = x0; i < x0 + 7; ++i)
                visit(static_cast<double>(x.at(i, j, k)), static_cast<double>(y.at(i, j, k)));
        };
        double mx = 0.0, my = 0.0, vx = 0.0, vy = 0.0, cov = 0.0;
        each([&](double a, double b) { mx += a / 343.0, my += b / 343.0; });
        each([&](double a, double b) {
          vx += (a - mx) * (a - mx) / 342.0;
          vy += (b - my) * (b - my) / 342.0;
          cov += (a - mx) * (b - my) / 342.0;
        });
        sum +=
            (2.0 * mx * my + c1) * (2.0 * cov + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2));
        ++windows;
      }
    }
  }
  return sum / windows;
}

TEST(Ssim, MatchesTheDefinitionAcrossBands) {
  const base::Shape3 shape{9, 45, 11};  // more rows than one band has windows
  const base::Volume truth = random_volume(shape, 1);
  base::Volume other = random_volume(shape, 2);
  for (std::size_t i = 0; i < other.data.size(); ++i)
    other.data[i] = 0.3f * other.data[i] + 0.5f * truth.data[i] + 0.1f;
  const SsimScore score = ssim(other, truth, 0.9, 1.4, -0.2);
  EXPECT_NEAR(score.raw, plain_ssim(other, truth, 0.9), 1e-12);
  for (float& v : other.data) v = 1.4f * v - 0.2f;
  EXPECT_NEAR(score.affine, plain_ssim(other, truth, 0.9), 1e-6);
}

TEST(Ssim, RefusesVolumesThinnerThanTheWindow) {
  const base::Volume thin(base::Shape3{20, 20, 6});
  EXPECT_THROW(ssim(thin, thin, 1.0, 1.0, 0.0), Error);
}

TEST(Psnr, FindsTheScaleAndOffsetThatWereApplied) {
  const base::Volume truth = random_volume({30, 31, 32}, 3);
  base::Volume other = truth;
  for (float& v : other.data) v = (v + 0.25f) / 2.0f;
  const PsnrScore score = psnr(other.data, truth.data);
  EXPECT_NEAR(score.scale, 2.0, 1e-6);
  EXPECT_NEAR(score.offset, -0.25, 1e-6);
  EXPECT_NEAR(score.correlation, 1.0, 1e-9);
  EXPECT_GT(score.affine_dB, 120.0);
  // The difference is truth / 2 − 1/8, of mean square 7/192 and peak 1.
  EXPECT_NEAR(score.raw_dB, 10.0 * std::log10(192.0 / 7.0), 0.1);
}

TEST(Psnr, TakesThePeakFromTheTruth) {
  const std::vector<float> truth{-1.0f, 0.0f, 3.0f, 0.0f}, other{-1.0f, 0.0f, 3.0f, 0.4f};
  const PsnrScore score = psnr(other, truth);
  EXPECT_DOUBLE_EQ(score.peak, 4.0);
  EXPECT_NEAR(score.raw_dB, 10.0 * std::log10(16.0 / 0.04), 1e-5);
}

TEST(Psnr, ConstantReconstructionHasNoScale) {
  const std::vector<float> truth{0.0f, 1.0f}, other{0.7f, 0.7f};
  const PsnrScore score = psnr(other, truth);
  EXPECT_EQ(score.scale, 0.0);
  EXPECT_EQ(score.offset, 0.5);
  EXPECT_EQ(score.correlation, 0.0);
  EXPECT_NEAR(score.affine_dB, 10.0 * std::log10(4.0), 1e-9);
}

TEST(Psnr, RefusesWhatHasNoScore) {
  const std::vector<float> fine{0.0f, 1.0f}, zero{0.0f, 0.0f}, one{1.1f, 1.1f};
  const std::vector<float> broken{0.0f, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_THROW(psnr(broken, fine), Error);
  EXPECT_THROW(psnr(fine, broken), Error);
  EXPECT_THROW(psnr(fine, zero), Error);
  EXPECT_THROW(psnr(fine, one), Error);
}

TEST(Compare, IsTheSameForAnyNumberOfThreads) {
  const base::Volume truth = random_volume({64, 70, 40}, 5), other = random_volume({64, 70, 40}, 6);
  const int threads = base::thread_count();
  base::set_thread_count(1);
  const Comparison one = compare({other, truth, whole_box(truth.shape)});
  base::set_thread_count(3);
  const Comparison three = compare({other, truth, whole_box(truth.shape)});
  base::set_thread_count(threads);
  EXPECT_EQ(one.psnr.raw_dB, three.psnr.raw_dB);
  EXPECT_EQ(one.psnr.affine_dB, three.psnr.affine_dB);
  EXPECT_EQ(one.ssim.raw, three.ssim.raw);
}

}  // namespace
}  // namespace tomofield::evaluate
