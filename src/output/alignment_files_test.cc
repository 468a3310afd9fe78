#include "output/alignment_files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "expect_parts.h"
#include "io/saving/output_set.h"
#include "io/tables/alignment_files.h"
#include "loaded_view.h"
#include "scratch_directory.h"
#include "warning_catcher.h"

namespace tomofield::output {
namespace {

using geometry::RawFromAligned;
using testing::expect_parts;
using testing::ScratchDirectory;
using testing::some_value;
using testing::WarningCatcher;
using testing::write_stack;
using tilt_series::PlannedSeries;
using tilt_series::TiltSeriesOptions;

constexpr std::array<std::int64_t, 3> kRawSize{40, 28, 6};

// Returns the options of a stack of six sections that are tilted by −25°, −15°, … 25°.
TiltSeriesOptions six_sections(const ScratchDirectory& scratch) {
  TiltSeriesOptions options;
  options.stack = write_stack(scratch / "raw.st", kRawSize[0], kRawSize[1], 6, some_value);
  options.tlt = scratch.write("raw.tlt", "-25\n-15\n-5\n5\n15\n25\n");
  options.contrast = Contrast::kBright;
  return options;
}

// Returns the text of an .xf file whose section s is turned by rotation_deg(s), magnified and
// shifted, as docs/geometry.md defines them.
std::string transforms(const std::function<double(int)>& rotation_deg, double magnification = 1) {
  std::string text;
  for (int section = 0; section < 6; ++section) {
    const double angle = rotation_deg(section) * std::numbers::pi / 180;
    const double c = std::cos(angle) / magnification, s = std::sin(angle) / magnification;
    text += fmt::format("{} {} {} {} {} {}\n", c, s, -s, c, 1.5 * section - 4, 2.25 - section);
  }
  return text;
}

// Reads the stack again by the files of IMOD that were written, unbinned.
PlannedSeries by_imod(const TiltSeriesOptions& options, const AlignmentFiles& files) {
  TiltSeriesOptions again = options;
  again.bin = 1;
  again.tilt_offset_deg = again.x_axis_tilt_deg = 0;
  again.aln.reset();
  again.xtilt.reset();
  again.xf = files.xf;
  again.tlt = files.tlt;
  if (std::filesystem::exists(files.xtilt)) again.xtilt = files.xtilt;
  return PlannedSeries(again);
}

// Does the same by the .aln, which says itself what is left out.
PlannedSeries by_aretomo(const TiltSeriesOptions& options, const AlignmentFiles& files) {
  TiltSeriesOptions again = options;
  again.bin = 1;
  again.tilt_offset_deg = again.x_axis_tilt_deg = 0;
  again.exclude.clear();
  again.tlt.reset();
  again.xf.reset();
  again.xtilt.reset();
  if (std::filesystem::exists(files.xtilt)) again.xtilt = files.xtilt;
  again.aln = files.aln;
  return PlannedSeries(again);
}

// Expects the same views, to the rounding of the files.
void expect_same(const PlannedSeries& read, const PlannedSeries& written) {
  ASSERT_EQ(read.views().size(), written.views().size());
  for (std::size_t i = 0; i < read.views().size(); ++i) {
    EXPECT_EQ(read.views()[i].section, written.views()[i].section);
    EXPECT_NEAR(read.views()[i].tilt_deg, written.views()[i].tilt_deg, 0.51e-4);
    EXPECT_NEAR(read.views()[i].x_tilt_deg, written.views()[i].x_tilt_deg, 0.51e-4);
    const RawFromAligned a = read.raw_from_aligned(i), b = written.raw_from_aligned(i);
    EXPECT_NEAR(a.m11, b.m11, 2e-7);
    EXPECT_NEAR(a.m12, b.m12, 2e-7);
    EXPECT_NEAR(a.m21, b.m21, 2e-7);
    EXPECT_NEAR(a.m22, b.m22, 2e-7);
    EXPECT_NEAR(a.shift_x_px, b.shift_x_px * written.bin_factor(), 1.1e-3);
    EXPECT_NEAR(a.shift_y_px, b.shift_y_px * written.bin_factor(), 1.1e-3);
  }
}

TEST(AlignmentFiles, AreNamedAfterThePrefix) {
  const AlignmentFiles files = alignment_files("out/TS_01.rec_aligned");
  EXPECT_EQ(files.xf, "out/TS_01.rec_aligned.xf");
  EXPECT_EQ(files.tlt, "out/TS_01.rec_aligned.tlt");
  EXPECT_EQ(files.xtilt, "out/TS_01.rec_aligned.xtilt");
  EXPECT_EQ(files.aln, "out/TS_01.rec_aligned.aln");
  EXPECT_EQ(files.all().size(), 4u);
}

// A section is left out at either end or in the middle, or none is.
TEST(AlignmentFiles, GiveTheSeriesBack) {
  for (const char* exclude : {"", "1", "3-4", "6", "1-2,5"}) {
    SCOPED_TRACE(exclude);
    const ScratchDirectory scratch;
    TiltSeriesOptions options = six_sections(scratch);
    options.xf = scratch.write("raw.xf", transforms([](int s) { return 3.0 + 0.1 * s; }));
    options.xtilt = scratch.write("raw.xtilt", "1\n1.25\n1\n1\n0.5\n1\n");
    options.exclude = exclude;
    options.tilt_offset_deg = 1.5;
    options.x_axis_tilt_deg = 3;
    options.bin = 1.7;
    const WarningCatcher warnings;
    const PlannedSeries series(options);
    const AlignmentFiles files = alignment_files(scratch / "out");
    write_alignment_files(series, kRawSize, files);
    expect_same(by_imod(options, files), series);
    expect_same(by_aretomo(options, files), series);
    EXPECT_EQ(warnings.text(), "");
  }
}

TEST(AlignmentFiles, GiveBackASeriesWhoseAxisIsNearX) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  options.xf = scratch.write("raw.xf", transforms([](int s) { return -94.0 + 0.1 * s; }));
  options.exclude = "2-3";
  const PlannedSeries series(options);
  ASSERT_EQ(series.aligned_width(), kRawSize[1]);
  const AlignmentFiles files = alignment_files(scratch / "out");
  write_alignment_files(series, kRawSize, files);
  for (const PlannedSeries& read : {by_imod(options, files), by_aretomo(options, files)}) {
    expect_same(read, series);
    EXPECT_EQ(read.aligned_width(), kRawSize[1]);
    EXPECT_EQ(read.aligned_height(), kRawSize[0]);
  }
}

// Worked by hand: a rotation by 90° is M = (0, −1; 1, 0), so A = (0, 1; −1, 0), and a raw shift of
// (4, 6) px is −A (4, 6) = (−6, 4). Views that are binned by 2 have the raw shift (2, 3).
TEST(AlignmentFiles, HaveTheNumbersWorkedByHand) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  std::string rows = "# RawSize = 40 28 6\n";
  for (int section = 0; section < 6; ++section)
    rows += fmt::format("{} 90 1 4 6 1 1 1 0 {}\n", section, 10 * section - 25);
  options.aln = scratch.write("raw.aln", rows);
  options.tlt.reset();
  options.bin = 2;
  const PlannedSeries series(options);
  ASSERT_NEAR(series.raw_from_aligned(0).shift_x_px, 2, 1e-12);
  const AlignmentFiles files = alignment_files(scratch / "out");
  write_alignment_files(series, kRawSize, files);
  for (const io::ImodTransform& t : io::read_imod_transforms(files.xf)) {
    EXPECT_EQ((std::array{t.a11, t.a12, t.a21, t.a22}), (std::array{0.0, 1.0, -1.0, 0.0}));
    EXPECT_EQ((std::array{t.shift_x_px, t.shift_y_px}), (std::array{-6.0, 4.0}));
  }
  for (const io::AreTomoRow& row : io::read_aretomo_alignment(files.aln).rows) {
    EXPECT_EQ((std::array{row.rotation_deg, row.magnification}), (std::array{90.0, 1.0}));
    EXPECT_EQ((std::array{row.shift_x_px, row.shift_y_px}), (std::array{4.0, 6.0}));
  }
  // An axis 3 px to the right of the middle of the aligned views moves the raw place by
  // M (3, 0) = (0, 3).
  write_alignment_files(series, kRawSize, files, 3.0);
  for (const io::ImodTransform& t : io::read_imod_transforms(files.xf))
    EXPECT_EQ((std::array{t.shift_x_px, t.shift_y_px}), (std::array{-9.0, 4.0}));
  for (const io::AreTomoRow& row : io::read_aretomo_alignment(files.aln, true).rows)
    EXPECT_EQ((std::array{row.shift_x_px, row.shift_y_px}), (std::array{4.0, 9.0}));
}

TEST(AlignmentFiles, KnowWhereTheAxisIsInAnyBin) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  SpecimenOptions specimen;
  specimen.thickness = 15;
  for (const int bin : {1, 2, 3}) {
    options.bin = bin;
    const PlannedSeries series(options);
    const TiltAxis middle = tilt_axis(series, specimen);
    EXPECT_EQ(middle.from_middle_px, 0.0);
    EXPECT_EQ(middle.thickness_px, bin == 2 ? 16 : 15);
    EXPECT_EQ(middle.height_px, middle.thickness_px / 2);
    SpecimenOptions moved = specimen;
    moved.axis_x = 23.0;
    moved.axis_z = 4.0;
    moved.shift_z = 2.0;
    const TiltAxis axis = tilt_axis(series, moved);
    EXPECT_NEAR(axis.from_middle_px, 23.0 - kRawSize[0] / 2.0, 1e-9);
    EXPECT_NEAR(axis.height_px, 6.0, 1e-9);
  }
}

// The tilts are −25°, −15°, 15° and 25° at the sections 1, 2, 5 and 6.
TEST(AlignmentFiles, HaveALineForSectionsThatAreLeftOut) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  options.xf = scratch.write("raw.xf", transforms([](int s) { return s == 1 ? 3.0 : 1.0; }));
  options.exclude = "3-4";
  const AlignmentFiles files = alignment_files(scratch / "out");
  write_alignment_files(PlannedSeries(options), kRawSize, files);
  const auto angles = io::read_number_column(files.tlt, "an angle");
  ASSERT_EQ(angles.size(), 6u);
  EXPECT_EQ(angles[2].value, -5.0);
  EXPECT_EQ(angles[3].value, 5.0);
  const io::ImodTransform left_out = io::read_imod_transforms(files.xf).at(2);
  const double mean = std::atan2(left_out.a12, left_out.a11) * 180 / std::numbers::pi;
  EXPECT_NEAR(mean, 1.5, 1e-3);
  EXPECT_NEAR(std::hypot(left_out.a11, left_out.a12), 1.0, 1e-6);
  EXPECT_EQ((std::array{left_out.shift_x_px, left_out.shift_y_px}), (std::array{0.0, 0.0}));
  const io::AreTomoAlignment aretomo = io::read_aretomo_alignment(files.aln);
  EXPECT_EQ(aretomo.dark_sections, (std::vector<std::int64_t>{3, 4}));
  EXPECT_EQ(aretomo.dark_tilt_deg, (std::vector<double>{-5.0, 5.0}));
}

TEST(AlignmentFiles, AnglesBeyondTheLastViewGoOnAndStayPlausible) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  options.exclude = "1,4-6";
  const AlignmentFiles files = alignment_files(scratch / "out");
  const auto angle = [&](std::size_t section) {
    write_alignment_files(PlannedSeries(options), kRawSize, files);
    return io::read_number_column(files.tlt, "an angle").at(section).value;
  };
  EXPECT_EQ(angle(0), -25.0);
  EXPECT_EQ(angle(5), 25.0);
  options.tlt = scratch.write("raw.tlt", "0\n3\n-60\n0\n0\n0\n");
  EXPECT_EQ(angle(0), 66.0);
  EXPECT_EQ(angle(5), -90.0);
  options.exclude = "1-2,4-6";
  EXPECT_EQ(angle(0), -60.0);
}

// A magnification of 1.02 moves a corner, √(20² + 14²) px from the centre, by 2 % of that.
TEST(AlignmentFiles, ACornerThatAreTomosFormatMovesIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  options.xf = scratch.write("raw.xf", transforms([](int) { return 2.0; }, 1.02));
  const AlignmentFiles files = alignment_files(scratch / "out");
  const WarningCatcher warnings;
  const PlannedSeries series(options);
  write_alignment_files(series, kRawSize, files);
  expect_parts(warnings.text(), {"out.aln", "0.49 pixels", "out.xf"});
  expect_same(by_imod(options, files), series);
  for (const io::AreTomoRow& row : io::read_aretomo_alignment(files.aln).rows) {
    EXPECT_EQ(row.rotation_deg, 2.0);
    EXPECT_EQ(row.magnification, 1.0);
  }
}

TEST(AlignmentFiles, MirroredViewsHaveNoAreTomoFile) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = six_sections(scratch);
  std::string text;
  for (int section = 0; section < 6; ++section) text += "-1 0 0 1 3 0\n";
  options.xf = scratch.write("raw.xf", text);
  const AlignmentFiles files = alignment_files(scratch / "out");
  const WarningCatcher warnings;
  const PlannedSeries series(options);
  write_alignment_files(series, kRawSize, files);
  expect_parts(warnings.text(), {"out.aln", "mirrored"});
  EXPECT_FALSE(std::filesystem::exists(files.aln));
  expect_same(by_imod(options, files), series);
}

TEST(AlignmentFiles, AnOldXtiltDoesNotStayBesideViewsWithoutOne) {
  const ScratchDirectory scratch;
  const AlignmentFiles files = alignment_files(scratch / "out");
  scratch.write("out.xtilt", "1\n");
  const PlannedSeries series(six_sections(scratch));
  io::OutputSet results;
  write_alignment_files(series, kRawSize, files);
  EXPECT_TRUE(std::filesystem::exists(files.xtilt));
  results.commit();
  EXPECT_FALSE(std::filesystem::exists(files.xtilt));
  EXPECT_TRUE(std::filesystem::exists(files.xf));
}

}  // namespace
}  // namespace tomofield::output
