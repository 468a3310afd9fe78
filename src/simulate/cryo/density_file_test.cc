#include "simulate/cryo/density_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "io/images/mrc.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

// Writes a map of 4-Å voxels with a ball of a density about a place, in voxels from the box's
// centre, on a background.
std::filesystem::path write_ball(const std::filesystem::path& path, double radius_A, float density,
                                 float background, double voxel_A = 4.0) {
  const std::int64_t n = 40;
  io::MrcWriter writer(
      path, {.nx = n, .ny = n, .nz = n, .voxel_size_A = {voxel_A, voxel_A, voxel_A}, .labels = {}});
  for (std::int64_t z = 0; z < n; ++z) {
    std::vector<float> section;
    for (std::int64_t y = 0; y < n; ++y)
      for (std::int64_t x = 0; x < n; ++x) {
        const auto c = [&](std::int64_t i) { return (static_cast<double>(i) - 19.5) * 4.0; };
        const double r = std::hypot(c(x) - 20.0, c(y), c(z) + 8.0);
        section.push_back(r < radius_A ? density : background);
      }
    writer.write_section(z, section);
  }
  writer.close();
  return path;
}

TEST(DensityFile, BallHasThePotentialOfProteinAtItsPlace) {
  const testing::ScratchDirectory scratch;
  const auto gaussians = read_density(write_ball(scratch / "ball.mrc", 30.0, 7.0f, 0.1f));
  double integral = 0.0;
  Vector3 centre{};
  for (const Gaussian& g : gaussians) {
    integral += g.integral_VA3;
    centre = moved(centre, g.integral_VA3, g.center_A);
  }
  centre = moved({}, 1.0 / integral, centre);
  const double volume = 4.0 / 3.0 * std::acos(-1.0) * std::pow(30.0, 3);
  EXPECT_NEAR(integral / (volume * 4.26 / 1.23), 1.0, 0.03);
  EXPECT_NEAR(centre[0], 20.0, 0.5);
  EXPECT_NEAR(centre[1], 0.0, 0.5);
  EXPECT_NEAR(centre[2], -8.0, 0.5);
}

TEST(DensityFile, DoesNotDependOnTheScaleOfTheMap) {
  const testing::ScratchDirectory scratch;
  const auto one = read_density(write_ball(scratch / "one.mrc", 30.0, 1.0f, 0.0f));
  const auto many = read_density(write_ball(scratch / "many.mrc", 30.0, 50.0f, 0.0f));
  ASSERT_EQ(one.size(), many.size());
  EXPECT_NEAR(one[0].integral_VA3 / many[0].integral_VA3, 1.0, 1e-6);
}

TEST(DensityFile, RefusesMapsWithoutDensityOrVoxelSize) {
  const testing::ScratchDirectory scratch;
  const auto on_pedestal = write_ball(scratch / "pedestal.mrc", 30.0, 240.0f, 40.0f);
  EXPECT_NE(testing::message_of<Error>([&] {
              read_density(on_pedestal);
            }).find("40 at its faces and up to 240"),
            std::string::npos);
  EXPECT_THROW(read_density(write_ball(scratch / "dark.mrc", 30.0, -1.0f, 0.0f)), Error);
  EXPECT_THROW(read_density(write_ball(scratch / "bare.mrc", 30.0, 1.0f, 0.0f, 0.0)), Error);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
    EXPECT_THROW(read_density(write_ball(scratch / "bad.mrc", 8.0, bad, 0.0f)), Error);
}

}  // namespace
}  // namespace tomofield::simulate
