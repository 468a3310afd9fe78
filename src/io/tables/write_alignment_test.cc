#include "io/tables/write_alignment.h"

#include <gtest/gtest.h>

#include <vector>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::read_whole_file;
using testing::ScratchDirectory;

TEST(WriteAlignment, AnglesHaveFourDecimalsALine) {
  const ScratchDirectory scratch;
  write_number_column(scratch / "a.tlt", std::vector<double>{-60.00004, -0.0, 359.5});
  EXPECT_EQ(read_whole_file(scratch / "a.tlt"), "-60.0000\n0.0000\n359.5000\n");
  EXPECT_THROW(write_number_column(scratch / "absent" / "a.tlt", std::vector<double>{1}), Error);
}

TEST(WriteAlignment, TransformsAreReadBackWhateverTheirSize) {
  const ScratchDirectory scratch;
  const std::vector<ImodTransform> written = {
      {0.99986295, 0.01655495, -0.01655495, 0.99986295, 12.3456, -0.75},
      {-70.1234567, -70.1234564, 70.1234561, -70.1234568, -9999999.123, -9999999.456},
      {1.0, -0.0, -0.0, 1.0, -0.0, 0.0}};
  write_imod_transforms(scratch / "a.xf", written);
  const auto read = read_imod_transforms(scratch / "a.xf");
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    for (double ImodTransform::*entry :
         {&ImodTransform::a11, &ImodTransform::a12, &ImodTransform::a21, &ImodTransform::a22})
      EXPECT_NEAR(read[i].*entry, written[i].*entry, 0.51e-7) << i;
    EXPECT_NEAR(read[i].shift_x_px, written[i].shift_x_px, 0.51e-3) << i;
    EXPECT_NEAR(read[i].shift_y_px, written[i].shift_y_px, 0.51e-3) << i;
  }
  const std::string text = read_whole_file(scratch / "a.xf");
  EXPECT_EQ(text.substr(text.rfind('\n', text.size() - 2) + 1),
            "   1.0000000   0.0000000   0.0000000   1.0000000       0.000       0.000\n");
}

TEST(WriteAlignment, AnMdocIsReadBack) {
  const ScratchDirectory scratch;
  Mdoc written;
  written.pixel_spacing_A = 2.17;
  written.image_file = "a.mrc";
  written.sections.resize(2);
  written.sections[1].section = 1;
  written.sections[1].tilt_deg = -57.5;
  written.sections[1].dose = 3.25;
  written.sections[1].prior_dose = 6.5;
  write_mdoc(scratch / "a.mdoc", written);
  const Mdoc read = read_mdoc(scratch / "a.mdoc");
  EXPECT_EQ(read.pixel_spacing_A, 2.17);
  EXPECT_EQ(read.image_file, "a.mrc");
  ASSERT_EQ(read.sections.size(), 2u);
  EXPECT_FALSE(read.sections[0].tilt_deg || read.sections[0].dose || read.sections[0].prior_dose);
  EXPECT_EQ(read.sections[1].section, 1);
  EXPECT_EQ(read.sections[1].tilt_deg, -57.5);
  EXPECT_EQ(read.sections[1].dose, 3.25);
  EXPECT_EQ(read.sections[1].prior_dose, 6.5);
}

// Returns an alignment of the sections 2, 3 and 5 of five; 1 and 4 are dark.
AreTomoAlignment some_alignment() {
  AreTomoAlignment alignment;
  alignment.raw_size = {4096, 4092, 5};
  alignment.dark_sections = {1, 4};
  alignment.dark_tilt_deg = {-60.0, 3.125};
  alignment.alpha_offset_deg = -1.25;
  alignment.beta_offset_deg = 0.5;
  alignment.thickness = 1234.5;
  for (const std::int64_t section : {2, 3, 5}) {
    const auto number = static_cast<double>(section);
    alignment.rows.push_back({.section = section,
                              .line = 0,
                              .rotation_deg = -94.123456 + number,
                              .magnification = 1.01});
    alignment.rows.back().shift_x_px = 123.45678 * number;
    alignment.rows.back().shift_y_px = -98765.4321;
    alignment.rows.back().tilt_deg = -70.0 + 14.123456 * number;
  }
  return alignment;
}

TEST(WriteAlignment, AreTomosAlignmentIsReadBack) {
  const ScratchDirectory scratch;
  const AreTomoAlignment written = some_alignment();
  write_aretomo_alignment(scratch / "a.aln", written);
  const AreTomoAlignment read = read_aretomo_alignment(scratch / "a.aln");
  EXPECT_EQ(read.raw_size, written.raw_size);
  EXPECT_EQ(read.dark_sections, written.dark_sections);
  EXPECT_EQ(read.dark_tilt_deg, written.dark_tilt_deg);
  EXPECT_EQ(read.alpha_offset_deg, written.alpha_offset_deg);
  EXPECT_EQ(read.beta_offset_deg, written.beta_offset_deg);
  EXPECT_EQ(read.thickness, written.thickness);
  EXPECT_TRUE(read.patches.empty());
  ASSERT_EQ(read.rows.size(), written.rows.size());
  for (std::size_t i = 0; i < read.rows.size(); ++i) {
    const AreTomoRow &a = read.rows[i], &b = written.rows[i];
    EXPECT_EQ(a.section, b.section);
    EXPECT_NEAR(a.rotation_deg, b.rotation_deg, 0.51e-5);
    EXPECT_NEAR(a.magnification, b.magnification, 0.51e-5);
    EXPECT_NEAR(a.shift_x_px, b.shift_x_px, 0.51e-3);
    EXPECT_NEAR(a.shift_y_px, b.shift_y_px, 0.51e-3);
    EXPECT_NEAR(a.tilt_deg, b.tilt_deg, 0.51e-4);
  }
  EXPECT_EQ(assign_aretomo_sections(read, "a.aln", 5, "a.st"),
            (std::vector<std::int64_t>{1, 2, 4}));
}

// Other programs look for these lines, so the text is as AreTomo has it.
TEST(WriteAlignment, AreTomosAlignmentHasItsHeader) {
  const ScratchDirectory scratch;
  AreTomoAlignment alignment = some_alignment();
  alignment.thickness.reset();
  alignment.dark_sections = {1};
  alignment.dark_tilt_deg = {-60.0};
  alignment.rows.resize(1);
  write_aretomo_alignment(scratch / "a.aln", alignment);
  EXPECT_EQ(read_whole_file(scratch / "a.aln"),
            "# AreTomo Alignment / Priims bprmMn\n"
            "# RawSize = 4096 4092 5\n"
            "# NumPatches = 0\n"
            "# DarkFrame =     1     1  -60.0000\n"
            "# AlphaOffset =  -1.2500\n"
            "# BetaOffset =   0.5000\n"
            "# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     BASE "
            "    TILT\n"
            "    2   -92.12346    1.01000     246.914  -98765.432     1.00     1.00     1.00     "
            "0.00  -41.7531\n");
}

}  // namespace
}  // namespace tomofield::io
