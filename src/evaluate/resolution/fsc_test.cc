#include "evaluate/resolution/fsc.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "base/threads/parallel.h"
#include "random_arrays.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

base::Volume random_volume(base::Shape3 shape, std::uint64_t seed) {
  base::Volume volume(shape, 4.0);
  volume.data = testing::random_floats(shape.voxels(), seed);
  return volume;
}

base::Volume ones(base::Shape3 shape) {
  base::Volume volume(shape);
  std::ranges::fill(volume.data, 1.0f);
  return volume;
}

// Returns cos 2π (kx x + ky y + kz z), where kx, ky and kz are whole cycles over each axis.
base::Volume wave(base::Shape3 shape, int kx, int ky, int kz) {
  base::Volume volume(shape, 4.0);
  const auto part = [](int k, std::int64_t i, std::int64_t n) {
    return static_cast<double>(k * i) / static_cast<double>(n);
  };
  for (std::int64_t z = 0; z < shape.nz; ++z)
    for (std::int64_t y = 0; y < shape.ny; ++y)
      for (std::int64_t x = 0; x < shape.nx; ++x)
        volume.at(x, y, z) = static_cast<float>(
            std::cos(2.0 * std::numbers::pi *
                     (part(kx, x, shape.nx) + part(ky, y, shape.ny) + part(kz, z, shape.nz))));
  return volume;
}

TEST(TransformVolume, MatchesTheDefinition) {
  const base::Shape3 shape{18, 5, 7};
  const auto re = testing::random_floats(shape.voxels(), 1);
  const auto im = testing::random_floats(shape.voxels(), 2);
  std::vector<std::complex<float>> values(shape.voxels());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = {re[i], im[i]};
  transform_volume(shape, values);
  for (const auto& [u, v, w] : {std::array{0, 0, 0}, {17, 4, 6}, {3, 1, 2}, {9, 0, 5}}) {
    std::complex<double> sum = 0.0;
    std::size_t i = 0;
    for (int z = 0; z < 7; ++z)
      for (int y = 0; y < 5; ++y)
        for (int x = 0; x < 18; ++x, ++i)
          sum +=
              std::complex(static_cast<double>(re[i]), static_cast<double>(im[i])) *
              std::polar(1.0, -2.0 * std::numbers::pi * (u * x / 18.0 + v * y / 5.0 + w * z / 7.0));
    const std::complex<double> found(values[static_cast<std::size_t>((w * 5 + v) * 18 + u)]);
    EXPECT_LT(std::abs(found - sum), 1e-4) << u << " " << v << " " << w;
  }
}

TEST(Fsc, IsOneForEqualVolumesMinusOneForInvertedOnesWhateverTheScale) {
  const base::Shape3 shape{20, 16, 9};
  const base::Volume volume = random_volume(shape, 3);
  base::Volume inverted = volume;
  for (float& v : inverted.data) v = 7.0f - 1e-3f * v;
  const Fsc same = fourier_shell_correlation(volume, volume, ones(shape), std::nullopt);
  const Fsc opposite = fourier_shell_correlation(volume, inverted, ones(shape), std::nullopt);
  ASSERT_EQ(same.all.correlation.size(), 10u);
  for (std::size_t s = 0; s < 10; ++s) {
    EXPECT_NEAR(same.all.correlation[s], 1.0, 1e-9);
    EXPECT_NEAR(opposite.all.correlation[s], -1.0, 1e-4);
  }
  EXPECT_FALSE(same.measured.has_value());
  EXPECT_DOUBLE_EQ(same.frequency_per_A.back(), 1.0 / 8.0);
}

TEST(Fsc, ShellsAreSpheresInAnUnevenBox) {
  // The periods are 4 voxels on every axis: 6 cycles over 24 voxels along x, 3 over 12 along y and
  // 2 over 8 along z. This is shell 6 of the longest axis.
  const base::Shape3 shape{24, 12, 8};
  const base::Volume a = random_volume(shape, 4), b = random_volume(shape, 5);
  const Fsc of_noise = fourier_shell_correlation(a, b, ones(shape), std::nullopt);
  for (const auto& common : {wave(shape, 6, 0, 0), wave(shape, 0, 3, 0), wave(shape, 0, 0, 2)}) {
    base::Volume first = a, second = b;
    for (std::size_t i = 0; i < common.data.size(); ++i) {
      first.data[i] += 30.0f * common.data[i];
      second.data[i] += 30.0f * common.data[i];
    }
    const Fsc fsc = fourier_shell_correlation(first, second, ones(shape), std::nullopt);
    EXPECT_LT(of_noise.all.correlation[5], 0.5);
    EXPECT_GT(fsc.all.correlation[5], 0.99);
    for (const std::size_t s : {0u, 1u, 2u, 3u, 4u, 6u, 7u, 8u, 9u, 10u, 11u})
      EXPECT_NEAR(fsc.all.correlation[s], of_noise.all.correlation[s], 1e-3) << s;
  }
}

TEST(TiltRange, FollowsTheSenseOfTheTilts) {
  // A view at +50° shows X cos 50° + Z sin 50°.
  const TiltRange range{-20.0, 50.0};
  const auto along = [&](double deg) {
    const double radians = deg * std::numbers::pi / 180.0;
    return range.covers(std::cos(radians), std::sin(radians));
  };
  EXPECT_TRUE(along(49.0));
  EXPECT_TRUE(along(49.0 - 180.0));
  EXPECT_FALSE(along(51.0));
  EXPECT_TRUE(along(-19.0));
  EXPECT_FALSE(along(-21.0));
  EXPECT_FALSE(along(90.0));
  EXPECT_TRUE(range.covers(0.0, 0.0));
}

TEST(Fsc, TellsMeasuredFrequenciesFromTheMissingWedge) {
  // Each of two waves is in one of the volumes only, a third one in both.
  const base::Shape3 shape{16, 16, 16};
  const base::Volume common = wave(shape, 3, 0, 3);  // 45°: a view at 45° shows it
  const base::Volume mirrored = wave(shape, 3, 0, -3);
  base::Volume first = common, second = common;
  const base::Volume noise_a = random_volume(shape, 8), noise_b = random_volume(shape, 9);
  for (std::size_t i = 0; i < first.data.size(); ++i) {
    first.data[i] += mirrored.data[i] + 1e-3f * noise_a.data[i];
    second.data[i] += -mirrored.data[i] + 1e-3f * noise_b.data[i];
  }
  const Fsc fsc = fourier_shell_correlation(first, second, ones(shape), TiltRange{-30.0, 60.0});
  const std::size_t shell = 4 - 1;  // √18 = 4.24
  EXPECT_NEAR(fsc.measured->correlation[shell], 1.0, 1e-3);
  EXPECT_NEAR(fsc.missing->correlation[shell], -1.0, 1e-3);
  EXPECT_NEAR(fsc.all.correlation[shell], 0.0, 1e-3);
  for (std::size_t s = 0; s < fsc.all.voxels.size(); ++s)
    EXPECT_EQ(fsc.measured->voxels[s] + fsc.missing->voxels[s], fsc.all.voxels[s]);
}

TEST(Fsc, SeesNothingOutsideOfTheMask) {
  const base::Shape3 shape{16, 16, 16};
  const base::Volume inside = random_volume(shape, 5);
  base::Volume first = inside, second = inside, mask(shape);
  for (std::int64_t z = 0; z < 16; ++z)
    for (std::int64_t y = 0; y < 16; ++y)
      for (std::int64_t x = 0; x < 16; ++x) {
        if (x >= 4 && x < 12) {
          mask.at(x, y, z) = 0.75f;
        } else {
          second.at(x, y, z) = 100.0f;
        }
      }
  const Fsc fsc = fourier_shell_correlation(first, second, mask, std::nullopt);
  for (const double value : fsc.all.correlation) EXPECT_NEAR(value, 1.0, 1e-9);
}

TEST(EdgeWindow, FallsToZeroAtTheFaces) {
  const base::Volume window = edge_window({32, 8, 16});
  EXPECT_EQ(window.at(16, 4, 8), 1.0f);
  EXPECT_EQ(window.at(4, 4, 8), 1.0f);
  // The voxel's centre is half a voxel into an edge of four.
  EXPECT_NEAR(window.at(0, 4, 8), std::pow(std::sin(std::numbers::pi / 16.0), 2), 1e-6);
  EXPECT_EQ(window.at(0, 4, 8), window.at(31, 4, 8));
  EXPECT_LT(window.at(16, 4, 0), 0.2f);
}

TEST(Crossing, IsLinearBetweenShells) {
  const std::vector<double> frequency{0.01, 0.02, 0.03, 0.04};
  const auto at = [&](std::vector<double> values, double threshold) {
    return crossing_A(frequency, {std::move(values), {}}, threshold);
  };
  EXPECT_NEAR(*at({0.9, 0.7, 0.3, 0.6}, 0.5), 1.0 / 0.025, 1e-9);
  EXPECT_NEAR(*at({0.9, std::nan(""), 0.1, 0.0}, 0.5), 1.0 / 0.02, 1e-9);
  EXPECT_FALSE(at({0.9, 0.8, 0.7, 0.6}, 0.5).has_value());
  EXPECT_FALSE(at({0.4, 0.8, 0.7, 0.2}, 0.5).has_value());
}

TEST(CorrelationAt, IsLinearBetweenShellsThatAreNotEmpty) {
  const std::vector<double> frequency{0.01, 0.02, 0.03, 0.04};
  const FscCurve curve{{0.9, 0.7, std::nan(""), 0.1}, {}};
  EXPECT_NEAR(*correlation_at(frequency, curve, 1.0 / 0.015), 0.8, 1e-9);
  EXPECT_NEAR(*correlation_at(frequency, curve, 1.0 / 0.03), 0.4, 1e-9);
  EXPECT_EQ(*correlation_at(frequency, curve, 100.0), 0.9);
  EXPECT_FALSE(correlation_at(frequency, curve, 200.0).has_value());
  EXPECT_FALSE(correlation_at(frequency, curve, 20.0).has_value());
}

TEST(Fsc, RefusesWhatCorrelatesWithNothing) {
  const base::Shape3 shape{8, 8, 8};
  const base::Volume fine = random_volume(shape, 6);
  base::Volume broken = fine, constant = ones(shape), weights = ones(shape);
  broken.data[5] = std::nanf("");
  for (float& v : constant.data) v = 0.1f;
  EXPECT_THROW(fourier_shell_correlation(fine, broken, weights, {}), Error);
  EXPECT_THROW(fourier_shell_correlation(constant, fine, weights, {}), Error);
  EXPECT_THROW(fourier_shell_correlation(fine, fine, base::Volume(shape), {}), Error);
  weights.data[7] = 1.5f;
  EXPECT_THROW(fourier_shell_correlation(fine, fine, weights, {}), Error);
  weights.data[7] = std::nanf("");
  EXPECT_THROW(fourier_shell_correlation(fine, fine, weights, {}), Error);
  const base::Volume tiny = random_volume({3, 3, 3}, 7);
  EXPECT_THROW(fourier_shell_correlation(tiny, tiny, ones({3, 3, 3}), {}), Error);
}

TEST(Fsc, IsTheSameForAnyNumberOfThreads) {
  const base::Shape3 shape{40, 33, 40};
  const base::Volume a = random_volume(shape, 10), b = random_volume(shape, 11);
  const auto curve = [&](int threads) {
    base::set_thread_count(threads);
    return fourier_shell_correlation(a, b, edge_window(shape), TiltRange{-60, 60});
  };
  const int threads = base::thread_count();
  const Fsc one = curve(1), three = curve(3);
  base::set_thread_count(threads);
  EXPECT_EQ(one.all.correlation, three.all.correlation);
  EXPECT_EQ(one.missing->correlation, three.missing->correlation);
}

}  // namespace
}  // namespace tomofield::evaluate
