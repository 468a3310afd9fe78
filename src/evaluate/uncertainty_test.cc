#include "evaluate/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "evaluate/box.h"
#include "half_files.h"

namespace tomofield::evaluate {
namespace {

using testing::HalfFiles;

constexpr base::Shape3 kShape{30, 26, 22};

// A ramp with white noise of these deviations at low and at high z.
base::Volume noisy(float low_z, float high_z, std::uint64_t seed) {
  base::Volume volume(kShape, 4.0);
  base::Random random(seed);
  for (std::int64_t z = 0; z < kShape.nz; ++z)
    for (std::int64_t y = 0; y < kShape.ny; ++y)
      for (std::int64_t x = 0; x < kShape.nx; ++x)
        volume.at(x, y, z) = static_cast<float>(x) + (2 * z < kShape.nz ? low_z : high_z) *
                                                         static_cast<float>(random.normal());
  return volume;
}

double mean_of_sections(const base::Volume& volume, std::int64_t first, std::int64_t end) {
  double sum = 0;
  for (std::int64_t z = first; z < end; ++z)
    for (std::int64_t y = 0; y < kShape.ny; ++y)
      for (std::int64_t x = 0; x < kShape.nx; ++x) sum += static_cast<double>(volume.at(x, y, z));
  return sum / static_cast<double>((end - first) * kShape.nx * kShape.ny);
}

TEST(Uncertainty, IsTheStandardErrorOfTheMeanOfIndependentNoise) {
  const HalfFiles halves(noisy(0.5f, 2.0f, 1), noisy(0.5f, 2.0f, 2));
  write_uncertainty(halves.even(), halves.odd(), halves.result());
  const base::Volume map = read_volume(halves.result());
  EXPECT_NEAR(mean_of_sections(map, 0, 8), 0.5 / std::sqrt(2), 0.01);
  EXPECT_NEAR(mean_of_sections(map, 14, 22), 2.0 / std::sqrt(2), 0.04);
}

TEST(Uncertainty, AveragesOverTheBoxThatLiesWithin) {
  const base::Volume even = noisy(1, 1, 1), odd = noisy(1, 1, 2);
  const HalfFiles halves(even, odd);
  write_uncertainty(halves.even(), halves.odd(), halves.result());
  const base::Volume map = read_volume(halves.result());
  double squares = 0;
  for (std::int64_t z = 0; z < 5; ++z)
    for (std::int64_t y = 22; y < 26; ++y)
      for (std::int64_t x = 7; x < 14; ++x)
        squares += std::pow(static_cast<double>(even.at(x, y, z) - odd.at(x, y, z)), 2);
  EXPECT_NEAR(map.at(10, 25, 1), std::sqrt(squares / (5 * 4 * 7)) / 2, 1e-5);
}

}  // namespace
}  // namespace tomofield::evaluate
