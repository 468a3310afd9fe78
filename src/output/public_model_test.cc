#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.h"
#include "field/sampling/sample_box.h"
#include "io/images/mrc.h"
#include "output/model_file.h"
#include "output/sampling_time.h"
#include "output/volume.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "tomofield/model.h"
#include "uneven_model.h"

namespace tomofield {
namespace {

TEST(PublicModel, SamplesWhatExportWrites) {
  const testing::ScratchDirectory scratch;
  auto inner = testing::uneven_model(FieldKind::kVm);
  inner.is_dark = true;
  output::save_model(scratch / "model.h5", inner);
  output::write_volume(inner, {}, scratch / "volume.mrc");

  const Model model(scratch / "model.h5");
  EXPECT_EQ(model.pixel_size_A(), inner.pixel_size_A);
  const SampleBox region = model.region();
  EXPECT_EQ(region.size, (std::array<std::int64_t, 3>{100, 116, 21}));
  const auto values = model.sample(region);
  const io::MrcReader volume(scratch / "volume.mrc");
  std::vector<float> section(100 * 116);
  for (std::int64_t z = 0; z < 21; ++z) {
    volume.read_section(z, section);
    EXPECT_TRUE(std::equal(section.begin(), section.end(), values.begin() + z * 100 * 116));
  }
}

TEST(PublicModel, TurnsBoxesByEulerAngles) {
  const testing::ScratchDirectory scratch;
  const auto inner = testing::uneven_model(FieldKind::kGrid);
  output::save_model(scratch / "model.h5", inner);
  const Model model(scratch / "model.h5");
  // rot 90: the box's x lies along the field's −y.
  const auto values = model.sample(
      {.centre_px = {30, 40, 10}, .size = {5, 1, 1}, .voxel_px = 1.0, .euler_deg = {90, 0, 0}});
  for (std::size_t x = 0; x < 5; ++x)
    EXPECT_NEAR(values[x], 40.0 * inner.field->density(30, 42 - static_cast<double>(x), 10), 1e-4);
}

TEST(PublicModel, RefusesBoxesLargerThanTheMemory) {
  const testing::ScratchDirectory scratch;
  output::save_model(scratch / "model.h5", testing::uneven_model(FieldKind::kVm));
  const Model model(scratch / "model.h5");
  const std::string message = testing::message_of<Error>([&] {
    (void)model.sample({.centre_px = {60, 60, 10}, .size = {20000, 20000, 20000}});
  });
  EXPECT_NE(message.find("20000 × 20000 × 20000 voxels needs about 29802.3 GiB of memory"),
            std::string::npos)
      << message;
}

// Returns what is said of the time that boxes take.
std::string said_of(const std::vector<field::OrientedBox>& boxes) {
  std::string said;
  base::set_log_sink([&](base::LogLevel, std::string_view text) { said += text; });
  output::announce_sampling(testing::uneven_model(FieldKind::kVm), boxes);
  base::set_log_sink({});
  return said;
}

TEST(PublicModel, SaysHowLongALargeBoxTakes) {
  field::OrientedBox box{.centre_px = {60, 60, 10},
                         .size = {100, 100, 100},
                         .field_from_box = field::rotation_from_euler(10, 20, 30)};
  EXPECT_EQ(said_of({box}), "");
  box.size = {10000, 10000, 90000};
  EXPECT_NE(said_of({box}).find("sampling 10000 × 10000 × 90000 voxels may take about"),
            std::string::npos);
}

TEST(PublicModel, CountsTheTimeOfPointsInTheModelAlone) {
  field::OrientedBox box{.centre_px = {60, 60, 10},
                         .size = {64, 64, 64},
                         .voxel_px = 2000,
                         .field_from_box = field::rotation_from_euler(0, 12, 1)};
  EXPECT_NE(said_of({box}).find("may take about"), std::string::npos);
  box.centre_px[0] = -300000;
  EXPECT_EQ(said_of({box}), "");
}

TEST(PublicModel, CountsTheTimeOfAllBoxes) {
  const field::OrientedBox box{.centre_px = {60, 60, 10},
                               .size = {100, 100, 100},
                               .voxel_px = 0.1,
                               .field_from_box = field::rotation_from_euler(10, 20, 30)};
  std::vector<field::OrientedBox> boxes(200000, box);
  boxes.front().centre_px[0] = 6000;
  const std::string said = said_of(boxes);
  EXPECT_NE(said.find("sampling 200000 times 100 × 100 × 100 voxels may take about"),
            std::string::npos)
      << said;
}

TEST(PublicModel, SamplesPoints) {
  const testing::ScratchDirectory scratch;
  auto inner = testing::uneven_model(FieldKind::kVm);
  inner.is_dark = true;
  output::save_model(scratch / "model.h5", inner);
  const Model model(scratch / "model.h5");
  std::vector<Point> points{{-1000, 0, 0}};
  for (int i = 1; i < 3000; ++i)
    points.push_back({10 + 0.03 * i, 4 + 0.035 * i, std::fmod(0.7 * i, 21.5)});
  const auto values = model.sample_points(points);
  ASSERT_EQ(values.size(), points.size());
  EXPECT_EQ(values[0], 0.0f);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const auto [x, y, z] = points[i];
    ASSERT_NEAR(values[i], -40.0 * inner.field->density(x, y, z), 1e-4) << i;
  }
  EXPECT_TRUE(model.sample_points({}).empty());
  points[5][2] = std::nan("");
  EXPECT_THROW(model.sample_points(points), Error);
}

TEST(PublicModel, TheRegionTurnsWithAnXAxisTilt) {
  const testing::ScratchDirectory scratch;
  auto inner = testing::uneven_model(FieldKind::kVm);
  inner.x_tilt_deg = 7.0;
  output::save_model(scratch / "model.h5", inner);
  const Model model(scratch / "model.h5");
  constexpr double kVoxel = 0.9;
  const auto values = model.sample(model.region(kVoxel));
  const auto expected = field::sample_box(*inner.field, output::region_box(inner, kVoxel));
  ASSERT_EQ(values.size(), expected.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    ASSERT_NEAR(values[i], 40.0f * expected[i], 1e-3) << i;
}

TEST(PublicModel, RefusesBoxesThatCannotBeSampled) {
  const testing::ScratchDirectory scratch;
  output::save_model(scratch / "model.h5", testing::uneven_model(FieldKind::kGrid));
  const Model model(scratch / "model.h5");
  EXPECT_THROW(model.sample({}), Error);
  EXPECT_THROW(model.sample({.centre_px = {0, std::nan(""), 0}, .size = {1, 1, 1}}), Error);
  EXPECT_THROW(model.sample({.centre_px = {}, .size = {1, 1, 1}, .voxel_px = 0}), Error);
  for (const double voxel_px : {0.0, -1.0, std::nan(""), HUGE_VAL})
    EXPECT_THROW(model.region(voxel_px), Error) << voxel_px;
  EXPECT_THROW(Model(scratch / "absent.h5"), Error);
}

}  // namespace
}  // namespace tomofield
