#include "view/viewed_volume.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/images/mrc.h"
#include "output/volume.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "uneven_model.h"

namespace tomofield::view {
namespace {

// Writes a volume of 6 × 5 × 4 voxels with the values x + 10 y + 100 z.
std::filesystem::path write_ramp(const testing::ScratchDirectory& directory) {
  io::MrcWriter writer(directory / "ramp.mrc",
                       {.nx = 6, .ny = 5, .nz = 4, .voxel_size_A = {2.0, 2.0, 2.0}, .labels = {}});
  for (int z = 0; z < 4; ++z) {
    std::vector<float> section;
    for (int y = 0; y < 5; ++y)
      for (int x = 0; x < 6; ++x) section.push_back(static_cast<float>(x + 10 * y + 100 * z));
    writer.write_section(z, section);
  }
  writer.close();
  return directory / "ramp.mrc";
}

TEST(ViewedMrc, HasItsVoxelsInPlanesAlongTheAxes) {
  const testing::ScratchDirectory directory;
  const auto volume = open_volume(write_ramp(directory));
  EXPECT_EQ(volume->size(), (std::array<std::int64_t, 3>{6, 5, 4}));
  EXPECT_EQ(volume->voxel_size_A(), 2.0);
  EXPECT_LT(volume->contrast().black, volume->contrast().white);
  const std::vector<float> xy = volume->sample({.centre = {3, 2.5, 2.5},
                                                .right = {1, 0, 0},
                                                .up = {0, 1, 0},
                                                .width = 12,
                                                .height = 5,
                                                .step = 1});
  ASSERT_EQ(xy.size(), 60u);
  for (std::size_t i = 0; i < xy.size(); ++i) {
    const std::size_t column = i % 12, row = i / 12;
    if (column < 3 || column >= 9)
      EXPECT_TRUE(std::isnan(xy[i])) << i << ", outside";
    else
      EXPECT_EQ(xy[i], static_cast<float>(column - 3 + 10 * row + 200)) << i;
  }
  const std::vector<float> zy = volume->sample({.centre = {1.2, 2.5, 2},
                                                .right = {0, 0, 1},
                                                .up = {0, 1, 0},
                                                .width = 8,
                                                .height = 10,
                                                .step = 0.5});
  for (std::size_t i = 0; i < zy.size(); ++i)
    EXPECT_EQ(zy[i], static_cast<float>(1 + 10 * (i / 8 / 2) + 100 * (i % 8 / 2))) << i;
}

TEST(ViewedMrc, IsInterpolatedInTurnedPlanesAndAveragedInLargePixels) {
  const testing::ScratchDirectory directory;
  const auto volume = open_volume(write_ramp(directory));
  const Plane turned{.centre = {3, 2.5, 2},
                     .right = {0.8, 0.6, 0},
                     .up = {-0.6, 0.8, 0},
                     .width = 3,
                     .height = 3,
                     .step = 0.7};
  const std::vector<float> values = volume->sample(turned);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Point at =
        turned.position(static_cast<double>(i % 3) + 0.5, static_cast<double>(i / 3) + 0.5);
    EXPECT_NEAR(values[i], at[0] - 0.5 + 10 * (at[1] - 0.5) + 100 * (at[2] - 0.5), 1e-4) << i;
  }
  const std::vector<float> mean = volume->sample({.centre = {3, 2, 2.5},
                                                  .right = {1, 0, 0},
                                                  .up = {0, 1, 0},
                                                  .width = 3,
                                                  .height = 2,
                                                  .step = 2});
  EXPECT_NEAR(mean[0], 0.5 + 5 + 200, 1e-4);
  EXPECT_NEAR(mean[5], 4.5 + 25 + 200, 1e-4);
}

// Holds a model in a file, and the voxels of its region as export writes them.
class ViewedModelTest : public ::testing::Test {
 protected:
  ViewedModelTest() : model_(testing::uneven_model(FieldKind::kGrid)) {
    output::save_model(directory_ / "model.h5", model_);
    output::write_volume(model_, {}, directory_ / "model.mrc");
  }

  const testing::ScratchDirectory directory_;
  output::Model model_;
};

TEST_F(ViewedModelTest, HasTheValuesOfTheExportedVolume) {
  const auto model = open_volume(directory_ / "model.h5"),
             volume = open_volume(directory_ / "model.mrc");
  ASSERT_EQ(model->size(), volume->size());
  EXPECT_NEAR(model->voxel_size_A(), volume->voxel_size_A(), 1e-6);
  const Point x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  const std::pair<Point, Point> planes[] = {{x, y}, {x, z}, {z, y}};
  for (const auto& [right, up] : planes) {
    const Plane plane{
        .centre = {50, 60, 10.5}, .right = right, .up = up, .width = 21, .height = 17, .step = 1};
    Plane moved = plane;  // to the middle of a voxel on every axis
    for (std::size_t axis = 0; axis < 3; ++axis)
      moved.centre[axis] = std::floor(moved.centre[axis]) + 0.5;
    const std::vector<float> found = model->sample(moved), expected = volume->sample(moved);
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (std::isnan(expected[i]))
        EXPECT_TRUE(std::isnan(found[i])) << i;
      else
        EXPECT_NEAR(found[i], expected[i], 1e-3) << i;
    }
  }
}

TEST_F(ViewedModelTest, HasTheFieldsValuesInTurnedPlanes) {
  const auto model = open_volume(directory_ / "model.h5");
  const Plane plane{.centre = {50, 60, 10},
                    .right = {0.8, 0, 0.6},
                    .up = {0, 1, 0},
                    .width = 5,
                    .height = 4,
                    .step = 0.3};
  const std::vector<float> values = model->sample(plane);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Point at =
        plane.position(static_cast<double>(i % 5) + 0.5, static_cast<double>(i / 5) + 0.5);
    // The region has 21 whole voxels in the middle of 21.5 pixels of thickness.
    const double density =
        model_.field->density(at[0] + static_cast<double>(model_.roi.x0),
                              at[1] + static_cast<double>(model_.roi.y0), at[2] + 0.25);
    EXPECT_NEAR(values[i], model_.output_scale() * density, 1e-3) << i;
  }
}

TEST(ViewedVolume, NamesAFileThatIsNone) {
  const testing::ScratchDirectory directory;
  EXPECT_THROW(open_volume(directory / "none.mrc"), Error);
  EXPECT_THROW(open_volume(directory.write("text.mrc", "no volume")), Error);
  EXPECT_THROW(open_volume(directory.write("text.h5", "\x89HDF\r\n\x1a\n")), Error);
}

}  // namespace
}  // namespace tomofield::view
