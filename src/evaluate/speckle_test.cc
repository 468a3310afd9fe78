#include "evaluate/speckle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Fills a volume with values of which many lie far from their neighbours.
base::Volume rough_volume(const base::Shape3& shape) {
  base::Volume volume(shape);
  base::Random random(5);
  for (float& value : volume.data) {
    const auto u = static_cast<float>(random.uniform());
    value = u * u * u;
  }
  return volume;
}

double deviation_of(const base::Volume& volume) {
  double sum = 0, squares = 0;
  const auto count = static_cast<double>(volume.data.size());
  for (const float v : volume.data) sum += static_cast<double>(v);
  for (const float v : volume.data) squares += std::pow(static_cast<double>(v) - sum / count, 2);
  return std::sqrt(squares / count);
}

// Sorts the neighbours of every inner voxel.
std::int64_t speckles_by_sorting(const base::Volume& volume) {
  const double deviation = deviation_of(volume);
  std::int64_t speckles = 0;
  for (std::int64_t z = 1; z + 1 < volume.shape.nz; ++z)
    for (std::int64_t y = 1; y + 1 < volume.shape.ny; ++y)
      for (std::int64_t x = 1; x + 1 < volume.shape.nx; ++x) {
        std::vector<float> around;
        for (std::int64_t i = 0; i < 27; ++i)
          around.push_back(volume.at(x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1));
        std::ranges::sort(around);
        const double distance = std::abs(static_cast<double>(volume.at(x, y, z) - around[13]));
        speckles += distance > deviation;
      }
  return speckles;
}

TEST(Speckle, IsWhatSortedNeighboursSay) {
  for (const base::Shape3& shape :
       {base::Shape3{5, 4, 3}, base::Shape3{20, 11, 7}, base::Shape3{600, 4, 3}}) {
    const base::Volume volume = rough_volume(shape);
    const auto expected = static_cast<double>(speckles_by_sorting(volume)) /
                          static_cast<double>(num_inner_voxels(shape));
    EXPECT_EQ(speckle(volume), expected) << shape.nx;
    EXPECT_GT(expected, 0.01);
  }
}

TEST(Speckle, IsASingleVoxelButNoneOfABlockOrAnEdge) {
  base::Volume volume({12, 10, 9});
  volume.at(3, 4, 5) = 1.0f;
  EXPECT_EQ(speckle(volume), 1.0 / (10 * 8 * 7));
  volume.at(0, 4, 5) = 1.0f;  // at the border nothing is counted
  EXPECT_EQ(speckle(volume), 1.0 / (10 * 8 * 7));
  base::Volume step({12, 10, 9});
  for (std::size_t i = 0; i < step.index(0, 0, 4); ++i) step.data[i] = 1.0f;
  EXPECT_EQ(speckle(step), 0.0);
}

TEST(Speckle, DoesNotDependOnScaleOrContrast) {
  base::Volume volume = rough_volume({30, 20, 10});
  const auto expected = speckle(volume);
  for (float& value : volume.data) value *= -1024.0f;
  EXPECT_EQ(speckle(volume), expected);
}

TEST(Speckle, NeedsThreeVoxelsAndNumbers) {
  EXPECT_EQ(speckle(rough_volume({30, 20, 2})), std::nullopt);
  EXPECT_EQ(speckle(base::Volume({5, 5, 5})), 0.0);
  base::Volume volume = rough_volume({5, 5, 5});
  volume.at(2, 2, 2) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(speckle(volume), Error);
}

}  // namespace
}  // namespace tomofield::evaluate
