#include "evaluate/resolution/block_fsc.h"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluate/box.h"
#include "half_files.h"
#include "random_arrays.h"

namespace tomofield::evaluate {
namespace {

using testing::HalfFiles;

// Two volumes with a common part.
HalfFiles related_halves(base::Shape3 shape) {
  base::Volume even(shape, 4.0), odd(shape, 4.0);
  even.data = testing::random_floats(shape.voxels(), 1);
  odd.data = testing::random_floats(shape.voxels(), 2);
  for (std::size_t i = 0; i < even.data.size(); ++i) odd.data[i] += even.data[i];
  return {even, odd};
}

TEST(BlockFsc, BlocksCoverAnAxisAlmostWithoutOverlap) {
  EXPECT_EQ(divide_axis(384, 384).begin, std::vector<std::int64_t>{0});
  const AxisBlocks blocks = divide_axis(1000, 384);
  EXPECT_EQ(blocks.length, 334);
  EXPECT_EQ(blocks.begin, (std::vector<std::int64_t>{0, 333, 666}));
}

TEST(BlockFsc, OneBlockIsTheShellCorrelationOfTheVolumes) {
  const HalfFiles halves = related_halves({18, 12, 10});
  const TiltRange tilts{-60, 60};
  const Fsc blocks = correlate_blocks(halves.even(), halves.odd(), tilts);
  const Fsc whole = fourier_shell_correlation(read_volume(halves.even()), read_volume(halves.odd()),
                                              edge_window({18, 12, 10}), tilts);
  EXPECT_EQ(blocks.frequency_per_A, whole.frequency_per_A);
  EXPECT_EQ(blocks.all.correlation, whole.all.correlation);
  EXPECT_EQ(blocks.measured->correlation, whole.measured->correlation);
  EXPECT_EQ(blocks.missing->voxels, whole.missing->voxels);
}

TEST(BlockFsc, SeveralBlocksGiveTheSameCurveWithFewerShells) {
  const HalfFiles halves = related_halves({48, 40, 36});
  const Fsc whole = correlate_blocks(halves.even(), halves.odd(), {});
  const Fsc blocks = correlate_blocks(halves.even(), halves.odd(), {}, 24);
  ASSERT_EQ(blocks.frequency_per_A.size(), 12u);
  EXPECT_NEAR(blocks.frequency_per_A.back(), 1 / 8.0, 1e-12);
  // Noise of one and of two variances correlates by 1 / √2 at all frequencies.
  for (std::size_t s = 3; s < 12; ++s) EXPECT_NEAR(blocks.all.correlation[s], std::sqrt(0.5), 0.05);
  for (std::size_t s = 6; s < 24; ++s) EXPECT_NEAR(whole.all.correlation[s], std::sqrt(0.5), 0.05);
}

// In a file with the axes xzy, rows count down along Z.
TEST(BlockFsc, TheWedgeFollowsTheAxesOfTheFile) {
  const TiltRange xyz{-20, 60}, xzy{-20, 60, VolumeAxes::kXzy};
  EXPECT_TRUE(xyz.covers(1, 0.3, 1));
  EXPECT_FALSE(xyz.covers(1, 0.3, -1));
  EXPECT_TRUE(xzy.covers(1, -1, 0.3));
  EXPECT_FALSE(xzy.covers(1, 1, 0.3));
}

TEST(BlockFsc, ABlockWithoutStructureCountsForNothing) {
  base::Volume even({32, 16, 16}, 4.0), odd = even;
  for (std::int64_t z = 0; z < 16; ++z)
    for (std::int64_t y = 0; y < 16; ++y)
      for (std::int64_t x = 16; x < 32; ++x)
        even.at(x, y, z) = odd.at(x, y, z) = static_cast<float>((x * y + z) % 5);
  const HalfFiles halves(even, odd);
  const Fsc fsc = correlate_blocks(halves.even(), halves.odd(), {}, 16);
  EXPECT_NEAR(fsc.all.correlation[2], 1.0, 1e-6);
}

}  // namespace
}  // namespace tomofield::evaluate
