#include "output/volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "io/images/mrc.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "uneven_model.h"

namespace tomofield::output {
namespace {

using testing::message_of;
using testing::ScratchDirectory;
using testing::uneven_model;

struct Written {
  io::MrcHeader header;
  std::vector<float> values;
  float at(std::int64_t x, std::int64_t row, std::int64_t section) const {
    return values[static_cast<std::size_t>((section * header.ny + row) * header.nx + x)];
  }
};

Written read(const std::filesystem::path& path) {
  const io::MrcReader reader(path);
  Written written{reader.header(), {}};
  const auto section = static_cast<std::size_t>(written.header.nx * written.header.ny);
  written.values.resize(section * static_cast<std::size_t>(written.header.nz));
  for (std::int64_t z = 0; z < written.header.nz; ++z)
    reader.read_section(
        z, std::span(written.values).subspan(static_cast<std::size_t>(z) * section, section));
  return written;
}

TEST(WriteVolume, WritesTheRegionOfInterestInTheInputsUnits) {
  const ScratchDirectory scratch;
  const auto model = uneven_model(FieldKind::kVm);
  write_volume(model, {}, scratch / "out.mrc");
  const Written out = read(scratch / "out.mrc");
  EXPECT_EQ(out.header.nx, 100);
  EXPECT_EQ(out.header.ny, 116);
  EXPECT_EQ(out.header.nz, 21);  // 21.5 is rounded to whole voxels
  EXPECT_TRUE(out.header.is_volume);
  for (const double size_A : out.header.voxel_size_A) EXPECT_NEAR(size_A, 3.3725, 1e-6);
  EXPECT_NEAR(out.header.origin_A[0], 10 * 3.3725, 1e-4);
  EXPECT_NEAR(out.header.origin_A[1], 4 * 3.3725, 1e-4);
  EXPECT_NEAR(out.header.origin_A[2], 0.25 * 3.3725, 1e-4);
  EXPECT_NEAR(out.at(7, 40, 3), 40.0 * model.field->density(17.5, 44.5, 3.75), 2e-4);
}

TEST(WriteVolume, KeepsOrInvertsTheContrastOfTheInput) {
  const ScratchDirectory scratch;
  auto model = uneven_model(FieldKind::kGrid);
  for (const bool is_dark : {false, true}) {
    for (const bool invert : {false, true}) {
      model.is_dark = is_dark;
      VolumeOptions options;
      options.invert = invert;
      write_volume(model, options, scratch / "out.mrc");
      const double sign = is_dark != invert ? -1.0 : 1.0;
      EXPECT_NEAR(read(scratch / "out.mrc").at(7, 40, 3),
                  sign * 40.0 * model.field->density(17.5, 44.5, 3.75), 2e-4);
    }
  }
}

// `trimvol -rx` turns sections along Y into sections along Z: z = rows − 1 − row.
TEST(WriteVolume, AxesXzyTurnBackByImodsRotation) {
  const ScratchDirectory scratch;
  const auto model = uneven_model(FieldKind::kVm);
  VolumeOptions options;
  const VolumePart part{.box = field::OrientedBox{
                            .centre_px = {31.0, 44.0, 9.5}, .size = {30, 21, 15}, .voxel_px = 1.0}};
  write_volume(model, options, scratch / "xyz.mrc", part);
  options.axes = VolumeAxes::kXzy;
  write_volume(model, options, scratch / "xzy.mrc", part);
  const Written xyz = read(scratch / "xyz.mrc"), xzy = read(scratch / "xzy.mrc");
  ASSERT_EQ(xzy.header.ny, 15);
  ASSERT_EQ(xzy.header.nz, 21);
  for (std::int64_t section = 0; section < 21; ++section) {
    for (std::int64_t row = 0; row < 15; ++row) {
      for (std::int64_t x = 0; x < 30; ++x)
        ASSERT_EQ(xzy.at(x, row, section), xyz.at(x, section, 15 - 1 - row));
    }
  }
  // The origin turns with the axes: rows count down from the upper face.
  EXPECT_EQ(xzy.header.origin_A[0], xyz.header.origin_A[0]);
  EXPECT_EQ(xzy.header.origin_A[2], xyz.header.origin_A[1]);
  EXPECT_NEAR(xzy.header.origin_A[1], (21.5 - 17.0) * 3.3725, 1e-4);
}

TEST(WriteVolume, ScalesIntegersAndSaysSo) {
  const ScratchDirectory scratch;
  const auto model = uneven_model(FieldKind::kVm);
  VolumeOptions options;
  write_volume(model, options, scratch / "float.mrc");
  options.voxel_type = VoxelType::kInt16;
  write_volume(model, options, scratch / "int16.mrc");
  options.voxel_type = VoxelType::kFloat16;
  write_volume(model, options, scratch / "float16.mrc");
  const Written exact = read(scratch / "float.mrc"), integers = read(scratch / "int16.mrc");
  const Written halves = read(scratch / "float16.mrc");
  EXPECT_EQ(integers.header.max, 32000.0);
  const std::string label = integers.header.labels.at(0);
  const auto at = label.find("stored = ");
  ASSERT_NE(at, std::string::npos) << label;
  const double factor = std::stod(label.substr(at + 9));
  for (std::size_t i = 0; i < exact.values.size(); ++i) {
    const double value = static_cast<double>(exact.values[i]);
    ASSERT_NEAR(static_cast<double>(integers.values[i]), factor * value, 0.6);
    ASSERT_NEAR(static_cast<double>(halves.values[i]), value, 1e-3 * std::abs(value) + 1e-6);
  }
}

TEST(WriteVolume, RefusesWhatCannotBeWritten) {
  const ScratchDirectory scratch;
  const auto model = uneven_model(FieldKind::kVm);
  VolumeOptions options;
  EXPECT_NE(message_of<Error>([&] { write_volume(model, options, scratch / "no" / "out.mrc"); }),
            "");
  const VolumePart part{.box = field::OrientedBox{.centre_px = {31.0, 44.0, 90.0},
                                                  .size = {30, 20, 15},
                                                  .voxel_px = 1.0}};
  const std::string message =
      message_of<Error>([&] { write_volume(model, options, scratch / "out.mrc", part); });
  EXPECT_NE(message.find("its z runs from 82.5 to 97.5"), std::string::npos) << message;
  EXPECT_EQ(scratch.num_files(), 0u);
}

// A point P of the specimen lies at C + Rx(alpha) (P − C) in the field, wherever the region of
// interest is, because p = Ry(tilt) Rx(alpha) (P − C) (docs/geometry.md).
TEST(WriteVolume, TurnsTheSpecimenBackByItsXTilt) {
  auto model = uneven_model(FieldKind::kVm);
  const field::OrientedBox straight = region_box(model, 1.0);
  model.x_tilt_deg = 30.0;
  const double c = std::cos(M_PI / 6), s = std::sin(M_PI / 6);
  for (const int hand : {1, -1}) {
    model.geometry.hand = hand;
    const field::OrientedBox turned = region_box(model, 1.0);
    EXPECT_EQ(turned.size, straight.size);
    const field::Point p = straight.position({3.5, 20.5, 15.5});
    const field::Point q = turned.position({3.5, 20.5, 15.5});
    const double y = p[1] - static_cast<double>(model.geometry.height) / 2;
    const double z = p[2] - model.geometry.axis_z;
    EXPECT_NEAR(q[0], p[0], 1e-9);
    EXPECT_NEAR(q[1] - static_cast<double>(model.geometry.height) / 2, c * y - hand * s * z, 1e-9);
    EXPECT_NEAR(q[2] - model.geometry.axis_z, hand * s * y + c * z, 1e-9);
  }
}

}  // namespace
}  // namespace tomofield::output
