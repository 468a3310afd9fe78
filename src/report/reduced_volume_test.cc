#include "report/reduced_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "scratch_directory.h"

namespace tomofield::report {
namespace {

using Size = std::array<std::int64_t, 3>;

io::MrcReader volume_of(const testing::ScratchDirectory& directory, const Size& size,
                        const std::vector<float>& voxels) {
  io::MrcWriter writer(directory / "volume.mrc",
                       {.nx = size[0], .ny = size[1], .nz = size[2], .labels = {}});
  const auto section = static_cast<std::size_t>(size[0] * size[1]);
  for (std::int64_t z = 0; z < size[2]; ++z)
    writer.write_section(z,
                         std::span(voxels).subspan(static_cast<std::size_t>(z) * section, section));
  writer.close();
  return io::MrcReader(directory / "volume.mrc");
}

std::vector<float> reduced(const io::MrcReader& volume, const Size& size) {
  std::vector<float> all(static_cast<std::size_t>(size[0] * size[1] * size[2]));
  reduce_volume(volume, size, [&](std::int64_t section, std::span<const float> values) {
    std::ranges::copy(values, all.begin() + section * size[0] * size[1]);
  });
  return all;
}

// Returns a voxel that is different everywhere and linear along every axis.
float ramp(double x, double y, double z) { return static_cast<float>(x + 10 * y + 100 * z); }

std::vector<float> ramp_voxels(const Size& size) {
  std::vector<float> voxels;
  for (std::int64_t z = 0; z < size[2]; ++z)
    for (std::int64_t y = 0; y < size[1]; ++y)
      for (std::int64_t x = 0; x < size[0]; ++x)
        voxels.push_back(
            ramp(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)));
  return voxels;
}

TEST(ReducedVolume, IsTheVolumeItselfAtItsSize) {
  const testing::ScratchDirectory directory;
  const Size size{7, 5, 3};
  EXPECT_EQ(reduced(volume_of(directory, size, ramp_voxels(size)), size), ramp_voxels(size));
}

TEST(ReducedVolume, HasMeansOfWholeAndPartialVoxels) {
  const testing::ScratchDirectory directory;
  const Size size{9, 5, 4}, smaller{6, 2, 3};  // factors 1.5, 2.5 and 4/3
  const std::vector<float> values = reduced(volume_of(directory, size, ramp_voxels(size)), smaller);
  // By hand: along x the first covers voxel 0 and half of 1, the last half of 7 and 8.
  const double x[] = {1.0 / 3, 5.0 / 3, 10.0 / 3, 14.0 / 3, 19.0 / 3, 23.0 / 3};
  const double y[] = {(0 + 1 + 0.5 * 2) / 2.5, (0.5 * 2 + 3 + 4) / 2.5};
  const double z[] = {(0 + 1.0 / 3) * 0.75, (2.0 / 3 + 2.0 / 3 * 2) * 0.75,
                      (1.0 / 3 * 2 + 3) * 0.75};
  for (std::size_t i = 0; i < values.size(); ++i)
    EXPECT_NEAR(values[i], ramp(x[i % 6], y[i / 6 % 2], z[i / 12]), 1e-4) << i;
}

TEST(ReducedVolume, TakesVoxelsThatAreNotFiniteAsZero) {
  const testing::ScratchDirectory directory;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  const io::MrcReader volume = volume_of(directory, {2, 2, 1}, {4, nan, infinity, 8});
  EXPECT_EQ(reduced(volume, {1, 1, 1}), std::vector<float>{3});
  EXPECT_EQ(sample_voxels(volume), (std::vector<float>{4, 8}));
}

TEST(ReducedVolume, HasASizeThatIsAllowed) {
  const auto size_of = [](std::int64_t nx, std::int64_t ny, std::int64_t nz, std::int64_t most) {
    io::MrcHeader header;
    header.nx = nx;
    header.ny = ny;
    header.nz = nz;
    return reduced_size(header, most);
  };
  EXPECT_EQ(size_of(100, 50, 20, 100'000), (Size{100, 50, 20}));
  EXPECT_EQ(size_of(100, 50, 20, 100'000 / 8), (Size{50, 25, 10}));
  const Size huge = size_of(8192, 8192, 2048, 40'000'000);
  EXPECT_LE(huge[0] * huge[1] * huge[2], 40'000'000);
  EXPECT_GT(huge[0] * huge[1] * huge[2], 39'000'000);
  EXPECT_EQ(size_of(100'000, 10, 1, 40'000'000), (Size{4096, 1, 1}));
}

TEST(SampleVoxels, ComeFromEvenlySpacedSections) {
  const testing::ScratchDirectory directory;
  const Size size{4, 2, 96};
  const std::vector<float> sample = sample_voxels(volume_of(directory, size, ramp_voxels(size)));
  ASSERT_EQ(sample.size(), 32u * 8u);
  for (std::size_t i = 0; i < sample.size(); ++i)
    EXPECT_EQ(static_cast<int>(sample[i] / 100), static_cast<int>(3 * (i / 8) + 1)) << i;
}

}  // namespace
}  // namespace tomofield::report
