#include "evaluate/resolution/local_resolution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "evaluate/box.h"
#include "half_files.h"

namespace tomofield::evaluate {
namespace {

using testing::HalfFiles;

constexpr TiltRange kAllTilts{-90, 90};

base::Volume white_noise(base::Shape3 shape, std::uint64_t seed) {
  base::Volume volume(shape, 4.0);
  base::Random random(seed);
  for (float& value : volume.data) value = static_cast<float>(random.normal());
  return volume;
}

// Removes all frequencies above a limit, in cycles a voxel.
base::Volume low_passed(const base::Volume& volume, double limit) {
  std::vector<std::complex<float>> values(volume.data.begin(), volume.data.end());
  const auto [nx, ny, nz] = volume.shape;
  transform_volume(volume.shape, values);
  std::size_t i = 0;
  for (std::int64_t z = 0; z < nz; ++z)
    for (std::int64_t y = 0; y < ny; ++y)
      for (std::int64_t x = 0; x < nx; ++x, ++i) {
        const double fx = static_cast<double>(signed_frequency(x, nx)) / static_cast<double>(nx);
        const double fy = static_cast<double>(signed_frequency(y, ny)) / static_cast<double>(ny);
        const double fz = static_cast<double>(signed_frequency(z, nz)) / static_cast<double>(nz);
        if (fx * fx + fy * fy + fz * fz > limit * limit) values[i] = 0;
      }
  for (auto& value : values) value = std::conj(value);
  transform_volume(volume.shape, values);  // of the conjugate: the inverse
  base::Volume result(volume.shape, volume.voxel_size_A);
  for (i = 0; i < values.size(); ++i)
    result.data[i] = values[i].real() / static_cast<float>(values.size());
  return result;
}

// Halves with a common part that has details up to other limits at low and at high x, and a little
// noise of their own, which is all that they have beyond these limits.
HalfFiles halves_with_limits(double low_x, double high_x) {
  const base::Shape3 shape{96, 48, 40};
  const base::Volume common = white_noise(shape, 1);
  const base::Volume left = low_passed(common, low_x), right = low_passed(common, high_x);
  base::Volume even = white_noise(shape, 2), odd = white_noise(shape, 3);
  for (std::int64_t z = 0; z < shape.nz; ++z)
    for (std::int64_t y = 0; y < shape.ny; ++y)
      for (std::int64_t x = 0; x < shape.nx; ++x)
        for (base::Volume* half : {&even, &odd})
          half->at(x, y, z) =
              0.1f * half->at(x, y, z) + (2 * x < shape.nx ? left : right).at(x, y, z);
  return {even, odd};
}

TEST(LocalResolution, FindsTheLimitOfDetailsInEachPlace) {
  const HalfFiles halves = halves_with_limits(0.12, 0.3);
  const LocalResolution found = local_resolution(halves.even(), halves.odd(), kAllTilts);
  // Shells are 1/32 wide, and each correlation looks at three of them.
  EXPECT_NEAR(found.at(10, 24, 20), 0.12 + 1.5 / 32, 0.035);
  EXPECT_NEAR(found.at(85, 24, 20), 0.3 + 1.5 / 32, 0.035);
  EXPECT_LT(found.percentile_px(10), found.percentile_px(90));
}

TEST(LocalResolution, HasItsEndsForEqualAndForUnrelatedHalves) {
  const base::Shape3 shape{40, 36, 20};
  const base::Volume noise = white_noise(shape, 1);
  const HalfFiles equal(noise, noise), unrelated(noise, white_noise(shape, 2)),
      empty(noise, base::Volume(shape, 4.0));
  for (const float f : local_resolution(equal.even(), equal.odd(), kAllTilts).frequency)
    EXPECT_EQ(f, 0.5f);
  for (const float f : local_resolution(empty.even(), empty.odd(), kAllTilts).frequency)
    EXPECT_EQ(f, 1 / 32.0f);
  const LocalResolution of_noise = local_resolution(unrelated.even(), unrelated.odd(), kAllTilts);
  EXPECT_GT(of_noise.percentile_px(50), 12);
}

TEST(LocalResolution, WritesAMapInAngstromsLikeTheHalves) {
  const HalfFiles halves = halves_with_limits(0.12, 0.3);
  const LocalResolution found = local_resolution(halves.even(), halves.odd(), kAllTilts);
  write_local_resolution(found, halves.even(), halves.result());
  const io::MrcReader map(halves.result());
  EXPECT_EQ(map.header().nx, 96);
  EXPECT_EQ(map.header().origin_A[1], -20);
  EXPECT_FLOAT_EQ(read_volume(halves.result()).at(70, 30, 9), 4.0f / found.at(70, 30, 9));
}

TEST(LocalResolution, IsTheSameForAnyNumberOfThreads) {
  const HalfFiles halves = halves_with_limits(0.12, 0.3);
  base::set_thread_count(1);
  const auto one = local_resolution(halves.even(), halves.odd(), {-60, 60}).frequency;
  base::set_thread_count(3);
  const auto three = local_resolution(halves.even(), halves.odd(), {-60, 60}).frequency;
  base::set_thread_count(0);
  EXPECT_EQ(one, three);
}

}  // namespace
}  // namespace tomofield::evaluate
