#include "tilt_series/tilt_axis.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "expect_parts.h"
#include "loaded_view.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using testing::expect_parts;
using testing::refusal;
using testing::ScratchDirectory;
using testing::small_series;
using testing::WarningCatcher;

// Gives the stack of a series these labels.
void write_labels(const TiltSeriesOptions& options, const std::vector<std::string>& labels) {
  io::MrcSpec spec;
  spec.nx = 16;
  spec.ny = 12;
  spec.nz = 3;
  spec.is_volume = false;
  spec.labels = labels;
  io::MrcWriter writer(options.stack, spec);
  for (std::int64_t section = 0; section < 3; ++section) {
    std::vector<float> values;
    for (std::int64_t i = 0; i < 16 * 12; ++i)
      values.push_back(testing::some_value(i % 16, i / 16, section));
    writer.write_section(section, values);
  }
  writer.close();
}

// Returns the direction of the axis by which the first view is turned, in degrees.
double axis_of(const TiltSeriesOptions& options) {
  return TiltSeries(options).raw_from_aligned(0).rotation_rad() * 180.0 / std::numbers::pi;
}

TEST(TiltAxis, OfTheHeadersTitleIsThatOfARawStack) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  const std::string title = "    Tilt axis angle = 85.3, binning = 1  spot = 8  camera = 2";
  write_labels(options, {"SerialEM: Digitized on a microscope", title});
  expect_parts(refusal(options), {"the header of", "a.st", "85.3", "--align full", "--ignore"});
  options.starts_raw = true;
  EXPECT_NEAR(axis_of(options), 85.3, 1e-9);
  EXPECT_EQ(TiltSeries(options).width(), 12);  // the axis is nearer to X
  options.starts_raw = false;
  options.ignore = "TiltAxisAngle";
  EXPECT_EQ(refusal(options), "");
  options.ignore = "";
  // newstack keeps the titles of the raw stack.
  write_labels(options, {title, "NEWSTACK: Images copied, transformed      27-Nov-26  10:00:00"});
  EXPECT_EQ(refusal(options), "");
  write_labels(options, {"Tilt axis angle = 0.4, binning = 1"});
  EXPECT_EQ(refusal(options), "");
  write_labels(options, {title, "Tilt axis angle = 85, binning = 1"});
  options.starts_raw = true;
  EXPECT_NEAR(axis_of(options), 85.3, 1e-9);
  write_labels(options, {title, "Tilt axis angle = 12, binning = 1"});
  expect_parts(refusal(options), {"a.st", "85.3°", "12°", "--tilt-axis"});
  options.tilt_axis_deg = 12;
  EXPECT_EQ(refusal(options), "");
}

TEST(TiltAxis, ThatIsGivenTurnsTheViews) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_labels(options, {"Tilt axis angle = 85.3, binning = 1"});
  options.tilt_axis_deg = -12.5;
  EXPECT_NEAR(axis_of(options), -12.5, 1e-9);
  EXPECT_EQ(TiltSeries(options).width(), 16);
  options.tilt_axis_deg = 0;
  EXPECT_EQ(axis_of(options), 0.0);
  options.xf = scratch.write("a.xf", "1 0 0 1 0 0\n1 0 0 1 0 0\n1 0 0 1 0 0\n");
  expect_parts(refusal(options), {"--tilt-axis", "--xf", "a.xf"});
}

TEST(TiltAxis, OfAnMdocComesBeforeThatOfTheHeader) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_labels(options, {"Tilt axis angle = 85.3, binning = 1"});
  const auto write_mdoc = [&](const std::string& title) {
    options.mdoc = scratch.write(
        "a.mdoc", title +
                      "\n[ZValue = 0]\nTiltAngle = -20\nRotationAngle = 86.2\n[ZValue = 1]\n"
                      "TiltAngle = -10\n[ZValue = 2]\nTiltAngle = 0\n");
  };
  options.starts_raw = true;
  write_mdoc("[T = Tilt axis angle = -94.1, binning = 1]");
  EXPECT_NEAR(axis_of(options), -94.1, 1e-9);
  write_mdoc("[T =   TiltAxisAngle = -176.20  Binning = 1  SpotSize = 6]");
  EXPECT_NEAR(axis_of(options), 86.2, 1e-9);
  write_mdoc("[T =   TiltAxisAngle = -20.20  Binning = 1  SpotSize = 6]");
  expect_parts(refusal(options), {"a.mdoc", "line 1", "-20.2", "--tilt-axis", "-69.8"});
  options.tilt_axis_deg = 84;
  EXPECT_EQ(refusal(options), "");
  options.tilt_axis_deg.reset();
  options.xf = scratch.write("a.xf", "1 0 0 1 0 0\n1 0 0 1 0 0\n1 0 0 1 0 0\n");
  EXPECT_EQ(refusal(options), "");  // the axis is not needed
}

TEST(TiltAxis, OfRotationAngleAloneIsNotGuessed) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.mdoc = scratch.write(
      "a.mdoc",
      "[FrameSet = 0]\nRotationAngle = 178.4\n[ZValue = 0]\nTiltAngle = -20\n[ZValue = 1]\n"
      "TiltAngle = -10\n[ZValue = 2]\nTiltAngle = 0\n");
  expect_parts(refusal(options),
               {"a.mdoc", "line 2", "RotationAngle = 178.4", "88.4", "--tilt-axis"});
  options.ignore = "TiltAxisAngle";
  EXPECT_EQ(refusal(options), "");
  options.ignore = "";
  write_labels(options, {"Tilt axis angle = 0.4, binning = 1"});
  EXPECT_EQ(refusal(options), "");
}

TEST(TiltAxis, OfTheOppositeDirectionIsNoVerticalOne) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  write_labels(options, {"Tilt axis angle = 180.0, binning = 1"});
  expect_parts(refusal(options), {"180", "from the vertical", "--align full"});
}

TEST(TiltAxis, ThatNoFileStatesIsSaidBeforeAnAlignment) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.starts_raw = true;
  const WarningCatcher warnings;
  EXPECT_EQ(refusal(options), "");
  expect_parts(warnings.text(), {"no file states the tilt axis", "a.st", "--tilt-axis"});
}

TEST(TiltAxis, OfAnAlignmentThatDiffersIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  const auto warning_with = [&](double axis_deg) {
    options.mdoc = scratch.write(
        "a.mdoc",
        fmt::format("[T = Tilt axis angle = {}, binning = 1]\n[ZValue = 0]\nTiltAngle = -20\n"
                    "[ZValue = 1]\nTiltAngle = -10\n[ZValue = 2]\nTiltAngle = 0\n",
                    axis_deg));
    const WarningCatcher warnings;
    EXPECT_EQ(refusal(options), "");
    return warnings.text();
  };
  const double c = std::cos(85 * std::numbers::pi / 180), s = std::sin(85 * std::numbers::pi / 180);
  const std::string row = fmt::format("{0} {1} -{1} {0} 0 0\n", c, s);
  options.xf = scratch.write("a.xf", row + row + row);
  EXPECT_EQ(warning_with(86.2), "");
  expect_parts(warning_with(-97), {"a.xf", "85.0°", "-97.0°", "mirrored in z"});
  expect_parts(warning_with(5), {"a.xf", "85.0°", "a.mdoc", "5.0°"});
}

TEST(TiltAxis, OfALoneRotationThatAnAlignmentContradictsIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  const auto warning_with = [&](double rotation_deg) {
    options.mdoc = scratch.write(
        "a.mdoc", fmt::format("[ZValue = 0]\nTiltAngle = -20\nRotationAngle = {}\n[ZValue = 1]\n"
                              "TiltAngle = -10\n[ZValue = 2]\nTiltAngle = 0\n",
                              rotation_deg));
    const WarningCatcher warnings;
    EXPECT_EQ(refusal(options), "");
    return warnings.text();
  };
  options.xf = scratch.write("a.xf", "1 0 0 1 0 0\n1 0 0 1 0 0\n1 0 0 1 0 0\n");
  for (const double rotation_deg : {90.0, -90.0, 92.0, -88.0})  // no rule tells the direction
    EXPECT_EQ(warning_with(rotation_deg), "") << rotation_deg;
  expect_parts(warning_with(175), {"a.xf", "0.0°", "a.mdoc", "rule of SerialEM", "85.0°"});
  options.ignore = "TiltAxisAngle";
  EXPECT_EQ(warning_with(175), "");
}

TEST(TiltAxis, OfATitleWithoutBracketsCounts) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.mdoc =
      scratch.write("a.mdoc",
                    "T =     Tilt axis angle = 85.0, binning = 1  spot = 7\n[ZValue = 0]\n"
                    "TiltAngle = -20\n[ZValue = 1]\nTiltAngle = -10\n[ZValue = 2]\n"
                    "TiltAngle = 0\n");
  expect_parts(refusal(options), {"a.mdoc", "line 1", "85°"});
}

TEST(TiltAngles, OfTwoFilesThatDifferAreSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);  // -20, -10, 0
  const auto warning_with = [&](const std::vector<double>& tilts) {
    std::string text;
    for (std::size_t i = 0; i < tilts.size(); ++i)
      text += fmt::format("[ZValue = {}]\nTiltAngle = {}\n", i, tilts[i]);
    options.mdoc = scratch.write("a.mdoc", text);
    const WarningCatcher warnings;
    EXPECT_EQ(refusal(options), "");
    return warnings.text();
  };
  EXPECT_EQ(warning_with({-20, -10, 0}), "");
  EXPECT_EQ(warning_with({-14, -4.5, 6}), "");  // a common offset, and a refinement
  expect_parts(warning_with({0, -10, -20}),
               {"a.tlt", "a.mdoc", "2 of 3", "section 1: -20° and 0°"});
  EXPECT_EQ(warning_with({-30, -20, -10, 0, 10}), "");  // the .mdoc of the uncut stack
  expect_parts(warning_with({-30, 30}), {"a.mdoc", "2 sections", "a.st", "3"});
}

TEST(TiltAngles, AllSectionsThatCannotBeAreNamedAtOnce) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch, 5);
  options.tlt = scratch.write("b.tlt", "-90\n-60\n0\n60\n90.5\n");
  expect_parts(refusal(options), {"b.tlt", "-90° of section 1 (line 1)",
                                  "90.5° of section 5 (line 5)", "--exclude 1,5"});
  options.tlt = scratch.write("b.tlt", "3\n3\n3\n3\n3\n");
  expect_parts(refusal(options), {"b.tlt", "all 5 sections", "3°"});
  options.exclude = "2-5";
  EXPECT_EQ(refusal(options), "");  // one view alone
}

TEST(TiltAxis, OfAnMdocThatStatesTwoIsSaid) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  options.starts_raw = true;
  options.mdoc = scratch.write("a.mdoc",
                               "[T = Tilt axis angle = 85.3, binning = 1]\nTiltAxisAngle = 12\n"
                               "[ZValue = 0]\nTiltAngle = -20\n[ZValue = 1]\nTiltAngle = -10\n"
                               "[ZValue = 2]\nTiltAngle = 0\n");
  const WarningCatcher warnings;
  EXPECT_NEAR(axis_of(options), 85.3, 1e-9);
  expect_parts(warnings.text(), {"a.mdoc", "85.3° in line 1", "12° in line 2"});
}

TEST(PixelSize, OfAnMdocIsThatOfItsOwnImages) {
  const ScratchDirectory scratch;
  TiltSeriesOptions options = small_series(scratch);
  testing::write_stack(options.stack, 16, 12, 3, testing::some_value, 1.0);
  const auto size_with = [&](const std::string& image_size) {
    options.mdoc = scratch.write("a.mdoc", "PixelSpacing = 5.4\n" + image_size +
                                               "[ZValue = 0]\n[ZValue = 1]\n[ZValue = 2]\n");
    return TiltSeries(options).pixel_size_A();
  };
  const WarningCatcher warnings;
  EXPECT_DOUBLE_EQ(size_with(""), 5.4);
  EXPECT_DOUBLE_EQ(size_with("ImageSize = 16 12\n"), 5.4);
  EXPECT_DOUBLE_EQ(size_with("ImageSize = 4 3\n"), 1.35);    // a binned record of these images
  EXPECT_DOUBLE_EQ(size_with("ImageSize = 32 24\n"), 10.8);  // these are binned
  EXPECT_EQ(warnings.text(), "");
  EXPECT_DOUBLE_EQ(size_with("ImageSize = 12 16\n"), 5.4);
  expect_parts(warnings.text(), {"a.mdoc", "12 × 16", "16 × 12", "--pixel-size"});
}

}  // namespace
}  // namespace tomofield::tilt_series
