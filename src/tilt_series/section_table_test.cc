#include "tilt_series/section_table.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numbers>
#include <string>

#include "scratch_directory.h"
#include "tilt_series/contradictions.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }

Matrix3d rotation_of(const io::ListedView& view) {
  return (AngleAxisd(radians(view.rotation_deg), Vector3d::UnitZ()) *
          AngleAxisd(radians(view.tilt_deg), Vector3d::UnitY()) *
          AngleAxisd(radians(view.x_tilt_deg), Vector3d::UnitX()))
      .toRotationMatrix();
}

/// Returns where this program projects a point: docs/geometry.md, "The full projection". Both are
/// zero-based indices, in which the middle of N pixels is (N − 1) / 2.
Vector3d our_projection(const AlignedSection& section, const Vector3d& index, const Vector3d& size,
                        const Vector3d& image) {
  const Vector3d from_middle = index - (size - Vector3d::Ones()) / 2;
  const Vector3d q = AngleAxisd(radians(section.tilt_deg), Vector3d::UnitY()) *
                     (AngleAxisd(radians(section.x_tilt_deg), Vector3d::UnitX()) * from_middle);
  const geometry::RawFromAligned& m = section.raw_from_aligned;
  return {m.m11 * q[0] + m.m12 * q[1] + m.shift_x_px + (image[0] - 1) / 2,
          m.m21 * q[0] + m.m22 * q[1] + m.shift_y_px + (image[1] - 1) / 2, 0.0};
}

class SizedStack : public io::ImageStack {
 public:
  SizedStack(std::int64_t width, std::int64_t height, std::int64_t sections) {
    header_.nx = width;
    header_.ny = height;
    header_.nz = sections;
  }
  const io::MrcHeader& header() const override { return header_; }
  std::string name() const override { return "stack"; }
  void read_section(std::int64_t, std::span<float>) const override {}

 private:
  io::MrcHeader header_;
};

const Vector3d kVolume(64, 48, 20);
const Vector3d kPoint(50, 7, 16);  // voxel of the volume, from 0
constexpr double kPixel_A = 2.5;

io::ListedView some_view() {
  io::ListedView view;
  view.tilt_deg = -37.0;
  view.x_tilt_deg = 3.0;
  view.rotation_deg = 84.0;
  view.shift_x_A = 17.0;
  view.shift_y_A = -6.0;
  return view;
}

AlignedSection convert(io::CentreRule centre, const SizedStack& stack) {
  const io::ViewTable table{"a.star", centre, false, {some_view()}, {}, {}};
  return *sections_of_views(table, stack, kPixel_A).of_section[0];
}

TEST(SectionTable, SaysThatMagnificationsOfAreTomoAreNotApplied) {
  const testing::ScratchDirectory folder;
  const SizedStack stack(64, 48, 2);
  const auto warnings_with = [&](const std::string& magnification) {
    const auto aln = folder.write("a.aln", "# RawSize = 64 48 2\n1 0 1 0 0 0 0 0 0 -10\n2 0 " +
                                               magnification + " 0 0 0 0 0 0 10\n");
    const testing::WarningCatcher warnings;
    EXPECT_EQ(sections_of_aretomo(aln, stack, true).of_section[1]->raw_from_aligned.m11, 1.0);
    return warnings.text();
  };
  EXPECT_EQ(warnings_with("1.00000"), "");
  EXPECT_NE(warnings_with("1.00200").find("GMAG"), std::string::npos);
}

TEST(SectionTable, SaysThatBetaOffsetOfAreTomoIsNotApplied) {
  const testing::ScratchDirectory folder;
  const auto warnings_with = [&](const std::string& offset) {
    const auto aln = folder.write("a.aln", "# RawSize = 64 48 2\n# BetaOffset = " + offset +
                                               "\n1 0 1 0 0 0 0 0 0 -10\n2 0 1 0 0 0 0 0 0 10\n");
    const testing::WarningCatcher warnings;
    sections_of_aretomo(aln, SizedStack(64, 48, 2), true);
    return warnings.text();
  };
  EXPECT_EQ(warnings_with("0.00"), "");
  EXPECT_NE(warnings_with("3.50").find("BetaOffset, 3.5°, is not applied"), std::string::npos);
}

TEST(SectionTable, SaysThatAreTomoAlignedAStackOfOtherSections) {
  const testing::ScratchDirectory folder;
  const auto warnings_with = [&](int stated, const std::string& dark) {
    const auto aln = folder.write(
        "a.aln",
        fmt::format("# RawSize = 64 48 {}\n{}1 0 1 0 0 0 0 0 0 -10\n2 0 1 0 0 0 0 0 0 10\n", stated,
                    dark));
    const testing::WarningCatcher warnings;
    sections_of_aretomo(aln, SizedStack(64, 48, 2), true);
    return warnings.text();
  };
  EXPECT_EQ(warnings_with(2, ""), "");
  EXPECT_EQ(warnings_with(3, "# DarkFrame = 2 3 20\n"), "");  // the stack is without it
  const std::string said = warnings_with(41, "");
  for (const char* part : {"a.aln", "41 sections", "RawSize", "2 rows"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

TEST(SectionTable, SaysThatATableStatesImagesOfAnotherSize) {
  const SizedStack stack(64, 48, 1);
  const auto warnings_with = [&](double width_A, double height_A) {
    io::ViewTable table{"a.xml", io::CentreRule::kHalfSize, false, {some_view()}, {}, {}};
    table.image_size_A = {width_A, height_A};
    const testing::WarningCatcher warnings;
    sections_of_views(table, stack, kPixel_A);
    return warnings.text();
  };
  EXPECT_EQ(warnings_with(161, 119), "");
  const std::string said = warnings_with(320, 240);
  for (const char* part : {"a.xml", "320 × 240 Å", "160 × 120 Å", "--pixel-size"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

TEST(SectionTable, SaysThatAnglesDifferFromTheNominalOnesOfTheTable) {
  const auto warnings_with = [](double last_deg) {
    SectionTable table{"a.star", {}};
    for (const double tilt_deg : {-20.0, 0.0, last_deg})
      table.of_section.push_back(AlignedSection{.tilt_deg = tilt_deg, .raw_from_aligned = {}});
    table.nominal_tilt_deg = {-18.0, 2.0, 22.0};
    const testing::WarningCatcher warnings;
    warn_of_other_nominal_angles(table);
    return warnings.text();
  };
  EXPECT_EQ(warnings_with(21.0), "");
  const std::string said = warnings_with(-60.0);
  for (const char* part : {"a.star", "rlnTomoNominalStageTiltAngle", "1 of 3", "-60"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

// RELION 5, Tomogram::setProjectionMatrix: the shift, int(size / 2) of the image, the rotations,
// and minus int(size / 2) of the volume, one after another on indices.
TEST(SectionTable, ProjectsAsRelionDoes) {
  for (const int width : {50, 51}) {
    const SizedStack stack(width, 40, 1);
    const io::ListedView view = some_view();
    const Vector3d volume_centre(32, 24, 10), image_centre(width / 2, 20, 0);
    const Vector3d relions = rotation_of(view) * (kPoint - volume_centre) + image_centre +
                             Vector3d(view.shift_x_A, view.shift_y_A, 0) / kPixel_A;
    const Vector3d ours = our_projection(convert(io::CentreRule::kWholePixel, stack), kPoint,
                                         kVolume, Vector3d(width, 40, 1));
    EXPECT_NEAR(ours[0], relions[0], 1e-12);
    EXPECT_NEAR(ours[1], relions[1], 1e-12);
  }
}

TEST(SectionTable, SetsTheAlignmentOfAListedView) {
  const SizedStack stack(51, 40, 1);
  for (const auto centre : {io::CentreRule::kWholePixel, io::CentreRule::kHalfSize}) {
    io::ListedView view;
    set_alignment(convert(centre, stack), centre, stack.header(), kPixel_A, view);
    EXPECT_EQ(view.tilt_deg, some_view().tilt_deg);
    EXPECT_EQ(view.x_tilt_deg, some_view().x_tilt_deg);
    EXPECT_EQ(view.rotation_deg, some_view().rotation_deg);
    EXPECT_NEAR(view.shift_x_A, some_view().shift_x_A, 1e-9);
    EXPECT_NEAR(view.shift_y_A, some_view().shift_y_A, 1e-9);
  }
}

// Warp's TiltSeries.GetPositionInAllTilts: centres at half of the sizes, the offset added. The
// table has the tilt with the sign turned: Euler(0, angle, −axis) is Rz(axis) Ry(−angle).
TEST(SectionTable, ProjectsAsWarpDoes) {
  const SizedStack stack(51, 40, 1);
  const io::ListedView view = some_view();
  const double angle = radians(-view.tilt_deg), psi = radians(-view.rotation_deg);
  Matrix3d euler;  // Matrix3.Euler of WarpLib with rot = 0
  euler << std::cos(psi) * std::cos(angle), std::sin(psi), -std::cos(psi) * std::sin(angle),
      -std::sin(psi) * std::cos(angle), std::cos(psi), std::sin(psi) * std::sin(angle),
      std::sin(angle), 0, std::cos(angle);
  const Matrix3d level = AngleAxisd(radians(view.x_tilt_deg), Vector3d::UnitX()).toRotationMatrix();
  const Vector3d warps = euler * (level * (kPoint - kVolume / 2)) + Vector3d(25.5, 20, 0) +
                         Vector3d(view.shift_x_A, view.shift_y_A, 0) / kPixel_A;
  const Vector3d ours = our_projection(convert(io::CentreRule::kHalfSize, stack), kPoint, kVolume,
                                       Vector3d(51, 40, 1));
  EXPECT_NEAR(ours[0], warps[0], 1e-12);
  EXPECT_NEAR(ours[1], warps[1], 1e-12);
}

TEST(SectionTable, LeavesOutViewsThatAreNotUsed) {
  const SizedStack stack(8, 8, 2);
  io::ViewTable table{"a.xml", io::CentreRule::kHalfSize, true, {some_view(), some_view()}, {}, {}};
  table.views[0].is_used = false;
  const SectionTable sections = sections_of_views(table, stack, kPixel_A);
  EXPECT_FALSE(sections.of_section[0]);
  EXPECT_TRUE(sections.of_section[1]);
}

}  // namespace
}  // namespace tomofield::tilt_series
