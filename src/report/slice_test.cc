#include "report/slice.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "io/images/mrc.h"
#include "png_picture.h"

namespace tomofield::report {
namespace {

namespace fs = std::filesystem;

class SlicePictures : public ::testing::Test {
 protected:
  SlicePictures() { fs::create_directories(directory_); }
  ~SlicePictures() override { fs::remove_all(directory_); }

  void write(std::int64_t nx, std::int64_t ny, std::int64_t nz, const std::vector<float>& voxels) {
    io::MrcWriter writer(mrc_, {.nx = nx, .ny = ny, .nz = nz, .labels = {}});
    const auto section = static_cast<std::size_t>(nx * ny);
    for (std::int64_t z = 0; z < nz; ++z)
      writer.write_section(
          z, std::span(voxels).subspan(static_cast<std::size_t>(z) * section, section));
    writer.close();
  }

  // Draws the planes and returns their pictures.
  std::array<fs::path, 3> draw() const {
    const std::array pictures{directory_ / "xy.png", directory_ / "xz.png", directory_ / "yz.png"};
    write_slice_pictures(mrc_, pictures);
    return pictures;
  }

  fs::path directory_ =
      fs::path(::testing::TempDir()) / ("tomofield_slices_test_" + std::to_string(::getpid()));
  fs::path mrc_ = directory_ / "volume.mrc";
};

TEST_F(SlicePictures, ShowEachVoxelAtItsPlace) {
  // One bright voxel lies where all three central planes meet. A dim one lies in each plane alone,
  // off every line of symmetry.
  const std::int64_t nx = 40, ny = 24, nz = 10;
  std::vector<float> voxels(static_cast<std::size_t>(nx * ny * nz), -3.0f);
  const auto voxel = [&](std::int64_t x, std::int64_t y, std::int64_t z) -> float& {
    return voxels[static_cast<std::size_t>((z * ny + y) * nx + x)];
  };
  for (std::int64_t x = 18; x < 22; ++x)
    for (std::int64_t y = 10; y < 14; ++y)
      for (std::int64_t z = 3; z < 7; ++z) voxel(x, y, z) = 5.0f;
  voxel(3, 4, 5) = 5.0f;    // the XY plane is z = 5
  voxel(30, 12, 8) = 5.0f;  // the XZ plane is y = 12
  voxel(20, 2, 1) = 5.0f;   // the YZ plane is x = 20
  write(nx, ny, nz, voxels);
  const auto paths = draw();
  const std::int64_t zoom = 22;  // 24 × 22 is the first multiple of the narrowest past 512
  const testing::PngPicture xy = testing::read_png(paths[0], PNG_FORMAT_GRAY),
                            xz = testing::read_png(paths[1], PNG_FORMAT_GRAY),
                            yz = testing::read_png(paths[2], PNG_FORMAT_GRAY);
  EXPECT_EQ(xy.width, nx * zoom);
  EXPECT_EQ(xy.height, ny * zoom);
  EXPECT_EQ(xz.height, nz * zoom);
  EXPECT_EQ(yz.width, ny * zoom);
  EXPECT_EQ(yz.height, nz * zoom);
  const auto pixel = [](const testing::PngPicture& picture, std::int64_t right, std::int64_t up) {
    return picture.at(right * zoom + zoom / 2, picture.height - 1 - up * zoom - zoom / 2);
  };
  EXPECT_EQ(pixel(xy, 3, 4), 255);
  EXPECT_EQ(pixel(xz, 30, 8), 255);
  EXPECT_EQ(pixel(yz, 2, 1), 255);
  EXPECT_EQ(pixel(xy, 20, 12), 255);
  EXPECT_EQ(pixel(xy, 4, 4), 0);
  EXPECT_EQ(pixel(xz, 3, 5), 0);  // it is in the XY plane only
  EXPECT_EQ(pixel(yz, 12, 8), 0);
}

TEST_F(SlicePictures, GreysAreThoseOfTheContrast) {
  const std::int64_t n = 512;
  std::vector<float> voxels(static_cast<std::size_t>(n * n));
  for (std::size_t i = 0; i < voxels.size(); ++i) voxels[i] = static_cast<float>(i % 512);
  voxels[0] = 1e9f;  // an outlier must not change the scale
  voxels[1] = std::numeric_limits<float>::quiet_NaN();
  write(n, n, 1, voxels);
  const testing::PngPicture xy = testing::read_png(draw()[0], PNG_FORMAT_GRAY);
  ASSERT_EQ(xy.width, n);
  EXPECT_EQ(xy.at(0, 511), 255);  // the first voxel is at the bottom left
  EXPECT_EQ(xy.at(1, 511), 0);
  EXPECT_EQ(xy.at(0, 0), 0);
  EXPECT_NEAR(xy.at(256, 100), 128, 2);
  EXPECT_EQ(xy.at(450, 100), 255);  // the middle three quarters go from black to white
  EXPECT_EQ(xy.at(511, 100), 255);
}

TEST_F(SlicePictures, ConstantVolumeIsNoFailure) {
  write(8, 8, 8, std::vector<float>(512, 2.0f));
  for (const auto& picture : draw()) EXPECT_TRUE(std::filesystem::exists(picture));
}

}  // namespace
}  // namespace tomofield::report
