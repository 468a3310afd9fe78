#include "io/tables/alignment_files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "expect_parts.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;
using Sections = std::vector<std::int64_t>;

TEST(NumberColumn, ReadsAnglesWithTheirLines) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.tlt", "  -60.5\r\n+3 \n\n1e1\n");
  const auto numbers = read_number_column(path, "an angle");
  ASSERT_EQ(numbers.size(), 3u);
  EXPECT_EQ(numbers[0].value, -60.5);
  EXPECT_EQ(numbers[1].value, 3.0);
  EXPECT_EQ(numbers[2].value, 10.0);
  EXPECT_EQ(numbers[2].line, 4);
}

TEST(NumberColumn, NamesFileLineAndText) {
  const ScratchDirectory scratch;
  for (const std::string bad :
       {"abc", "1.5x", "nan", "inf", "1,5", "--3", "+-3", "1e999", "361", "1 2"}) {
    const auto path = scratch.write("a.tlt", "1\n" + bad + "\n");
    expect_parts(message_of<Error>([&] { read_number_column(path, "an angle"); }),
                 {"a.tlt", "line 2", bad, "an angle"});
  }
  EXPECT_THROW(read_number_column(scratch / "absent.tlt", "an angle"), Error);
  EXPECT_THROW(read_number_column(scratch.write("b.tlt", std::string(2000, '\0')), "an angle"),
               Error);
}

TEST(NumberColumn, QuotesLongLinesInPart) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.tlt", std::string(1 << 20, 'x'));
  const auto said = message_of<Error>([&] { read_number_column(path, "an angle"); });
  EXPECT_LT(said.size(), 400u);
  expect_parts(said, {"a.tlt", "line 1", "xxx"});
}

TEST(NumberColumn, RefusesFilesThatAreTooLarge) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& text) {
    const auto path = scratch.write("a.tlt", text);
    return message_of<Error>([&] { read_number_column(path, "an angle"); });
  };
  std::string lines;
  for (int i = 0; i < (1 << 20) + 1; ++i) lines += "1\n";
  expect_parts(read(lines), {"a.tlt", "lines"});
  expect_parts(read(std::string((16 << 20) + 1, '\n')), {"a.tlt", "16777217", "16 MiB"});
}

TEST(ImodTransforms, ReadsSixNumbersALine) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.xf", "   0.9 0.1 -0.1 0.9   12.5  -3\n1 0 0 1 0 0\n");
  const auto transforms = read_imod_transforms(path);
  ASSERT_EQ(transforms.size(), 2u);
  EXPECT_EQ(transforms[0].a12, 0.1);
  EXPECT_EQ(transforms[0].a21, -0.1);
  EXPECT_EQ(transforms[0].shift_x_px, 12.5);
  EXPECT_EQ(transforms[0].shift_y_px, -3.0);
}

TEST(ImodTransforms, ReadsMirrorsAndChangesOfScale) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.xf", "1 0 0 1 0 0\n4 0 0 4 0 0\n0.25 0 0 0.3 9999 0\n");
  EXPECT_EQ(read_imod_transforms(path).size(), 3u);
  const auto mirrors = scratch.write("b.xf", "-1 0 0 1 0 0\n-4 0 0 4 0 0\n");
  EXPECT_EQ(read_imod_transforms(mirrors).size(), 2u);
}

TEST(ImodTransforms, RefuseALineThatMirrorsAmongOthers) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    const auto path = scratch.write("a.xf", text);
    return message_of<Error>([&] { read_imod_transforms(path); });
  };
  const std::string plain = "1 0 0 1 0 0\n", mirror = "-1 0 0 1 0 0\n";
  expect_parts(refusal(plain + mirror + plain), {"a.xf', line 2", "-1 0 0 1 0 0", "mirrors"});
  expect_parts(refusal(mirror + mirror + plain), {"a.xf', line 3", "does not mirror"});
}

TEST(ImodTransforms, RefusesMalformedLines) {
  const ScratchDirectory scratch;
  for (const std::string bad :
       {"1 0 0 1 0", "1 0 0 1 0 0 0", "1 0 0 1 0 nan", "1 2 2 4 0 0", "0 0 0 0 0 0",
        "1e200 1e200 1e200 2e200 0 0", "1e-160 0 0 1e160 0 0", "1e9 0 0 1e9 0 0",
        "1000 999.999 999.999 1000 0 0", "1e-3 0 0 1e-3 0 0", "1 0 0 1 1e300 0"}) {
    const auto path = scratch.write("a.xf", "1 0 0 1 0 0\n" + bad + "\n");
    expect_parts(message_of<Error>([&] { read_imod_transforms(path); }), {"a.xf", "line 2", bad});
  }
}

std::string aln_row(int section) {
  return std::to_string(section) + " 85.5 1.0 3.5 -2.25 nan 1.0 1.0 0.0 " +
         std::to_string(10 * section - 20) + "\n";
}

TEST(AreTomoAlignment, ReadsHeaderGlobalAndLocalRows) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.aln", R"(# AreTomo Alignment / Priims bprmMn
# RawSize = 64 48 3
# NumPatches = 1
# DarkFrame =     0    1   -10.00
# AlphaOffset =     1.50
# BetaOffset =     0.25
# Thickness = 1240
# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     BASE     TILT
)" + aln_row(0) + aln_row(2) + "# Local Alignment\n0 0 1.0 2.0 0.1 0.2 1.0\n1 0 1 2 nan 0 0\n");
  const AreTomoAlignment alignment = read_aretomo_alignment(path);
  EXPECT_EQ(*alignment.raw_size, (std::array<std::int64_t, 3>{64, 48, 3}));
  EXPECT_EQ(alignment.dark_sections, Sections{1});
  EXPECT_EQ(alignment.alpha_offset_deg, 1.5);
  EXPECT_EQ(alignment.beta_offset_deg, 0.25);
  EXPECT_EQ(alignment.dark_tilt_deg, std::vector<double>{-10});
  EXPECT_EQ(alignment.thickness, 1240);
  ASSERT_EQ(alignment.rows.size(), 2u);
  EXPECT_EQ(alignment.rows[1].section, 2);
  EXPECT_EQ(alignment.rows[1].rotation_deg, 85.5);
  EXPECT_EQ(alignment.rows[1].shift_x_px, 3.5);
  EXPECT_EQ(alignment.rows[1].shift_y_px, -2.25);
  EXPECT_EQ(alignment.rows[1].tilt_deg, 0.0);
  ASSERT_EQ(alignment.patches.size(), 2u);
  ASSERT_EQ(alignment.patches[0].size(), 1u);
  EXPECT_EQ(alignment.patches[0][0].y_px, 2.0);
  EXPECT_EQ(alignment.patches[0][0].shift_x_px, 0.1);
  EXPECT_TRUE(alignment.patches[1].empty());  // AreTomo calls it bad
}

TEST(AreTomoAlignment, RefusesAHeaderThatContradictsTheFile) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& head, const std::string& tail = "") {
    return message_of<Error>(
        [&] { read_aretomo_alignment(scratch.write("a.aln", head + "\n" + aln_row(0) + tail)); });
  };
  EXPECT_EQ(refusal("# Thickness = 24\n# Thickness = 24"), "");
  expect_parts(refusal("# Thickness = 24\n# Thickness = 90"), {"a.aln", "line 2", "Thickness"});
  expect_parts(refusal("# RawSize = 48.9 48 1"), {"line 1", "RawSize", "whole"});
  expect_parts(refusal("# DarkFrame = 3.7 3"), {"line 1", "DarkFrame", "whole"});
  expect_parts(refusal("# NumPatches = 4"), {"a.aln", "NumPatches = 4", "no rows"});
  expect_parts(refusal("# NumPatches = 1", "# Local Alignment\n0 0 1 2 0.1 0.2 abc\n"),
               {"a.aln", "line 4", "flag"});
  expect_parts(refusal("# NumPatches = 0", "# Local Alignment\n0 0 1 2 0.1 0.2 1\n"),
               {"a.aln", "line 4", "NumPatches = 0"});
}

TEST(AreTomoAlignment, RefusesMalformedRows) {
  const ScratchDirectory scratch;
  const std::pair<std::string, std::string> rows[] = {
      {"0 85 1 2 3 4 5 6 7", "0 85 1 2 3 4 5 6 7"},
      {"x 85 1 0 0 0 0 0 0 10", "x 85 1"},
      {"-1 85 1 0 0 0 0 0 0 10", "-1 85"},
      {"99999999999 85 1 0 0 0 0 0 0 10", "99999999999 85"},
      {"0 85 1 0 0 0 0 0 0 steep", "TILT of AreTomo's row is 'steep'"},
      {"0 1e300 1 0 0 0 0 0 0 10", "ROT of AreTomo's row is '1e300'"},
      {"0 85 0 0 0 0 0 0 0 10", "GMAG of AreTomo's row is '0'"},
      {"0 85 -1 0 0 0 0 0 0 10", "GMAG of AreTomo's row is '-1'"},
      {"0 85 1 1e300 0 0 0 0 0 10", "TX of AreTomo's row is '1e300'"},
      {"0 85 1 0 0 0 0 0 0 inf", "TILT of AreTomo's row is 'inf'"}};
  for (const auto& [bad, part] : rows) {
    const auto path = scratch.write("a.aln", aln_row(0) + bad + "\n");
    expect_parts(message_of<Error>([&] { read_aretomo_alignment(path); }),
                 {"a.aln", "line 2", part});
  }
  EXPECT_THROW(read_aretomo_alignment(scratch.write("a.aln", "# RawSize = 1 2 3\n")), Error);
  EXPECT_THROW(read_aretomo_alignment(scratch.write("a.aln", "# RawSize = 1 2\n" + aln_row(0))),
               Error);
  EXPECT_THROW(
      read_aretomo_alignment(scratch.write("a.aln", "# RawSize = 1e30 2 3\n" + aln_row(0))), Error);
}

Sections assign(const Sections& rows, const Sections& dark, std::int64_t num_sections) {
  AreTomoAlignment alignment;
  alignment.dark_sections = dark;
  for (const auto section : rows) {
    alignment.rows.emplace_back();
    alignment.rows.back().section = section;
  }
  return assign_aretomo_sections(alignment, "a.aln", num_sections, "a.st");
}

TEST(AreTomoSections, EveryWayOfCounting) {
  EXPECT_EQ(assign({0, 1, 2}, {}, 3), (Sections{0, 1, 2}));
  EXPECT_EQ(assign({1, 2, 3}, {}, 3), (Sections{0, 1, 2}));
  EXPECT_EQ(assign({2, 0, 1}, {}, 3), (Sections{2, 0, 1}));   // sorted by tilt
  EXPECT_EQ(assign({0, 2, 3}, {1}, 4), (Sections{0, 2, 3}));  // before removal
  EXPECT_EQ(assign({2, 3, 4}, {1}, 4), (Sections{1, 2, 3}));  // before removal, from 1
  EXPECT_EQ(assign({0, 1, 2}, {1}, 4), (Sections{0, 2, 3}));  // after removal
  EXPECT_EQ(assign({1, 2, 3}, {2}, 4), (Sections{0, 2, 3}));  // after removal, from 1
  EXPECT_EQ(assign({0, 2, 3}, {1}, 3), (Sections{0, 1, 2}));  // dark frames removed from the stack
  EXPECT_EQ(assign({0, 1, 2}, {1}, 3), (Sections{0, 1, 2}));
  for (const std::int64_t num_sections : {3, 4})
    expect_parts(message_of<Error>([&] {
                   assign({0, 1, 2}, {9}, num_sections);
                 }),
                 {"a.aln", "dark frame 9", "4 sections with the dark ones"});
}

// Assigns rows of these tilts, numbered from `first`, beside dark frames whose section is 0.
Sections assign_by_tilt(const std::vector<double>& tilts, const std::vector<double>& dark,
                        std::int64_t first, double alpha_deg = 0) {
  AreTomoAlignment alignment;
  alignment.alpha_offset_deg = alpha_deg;
  alignment.dark_sections.assign(dark.size(), 0);
  alignment.dark_tilt_deg = dark;
  for (const double tilt_deg : tilts) {
    alignment.rows.emplace_back();
    alignment.rows.back().section = first + std::ssize(alignment.rows) - 1;
    alignment.rows.back().tilt_deg = tilt_deg;
  }
  return assign_aretomo_sections(alignment, "a.aln", std::ssize(tilts) + std::ssize(dark), "a.st");
}

TEST(AreTomoSections, DarkFramesWithoutSectionsAreFoundByTilt) {
  for (const std::int64_t first : {0, 1, 3}) {
    EXPECT_EQ(assign_by_tilt({-20, 0, 20}, {-10, 30}, first), (Sections{0, 2, 3}));
    EXPECT_EQ(assign_by_tilt({20, 0, -20}, {-10, 30}, first), (Sections{1, 2, 4}));
    EXPECT_EQ(assign_by_tilt({-18, 2, 22}, {-10, 30}, first, 2), (Sections{0, 2, 3}));
  }
  // The offset decides, rows are in no order, or a tilt is there twice.
  EXPECT_THROW(assign_by_tilt({-18, 2, 22}, {1}, 1, 2), Error);
  EXPECT_THROW(assign_by_tilt({0, -20, 20}, {10}, 1), Error);
  EXPECT_THROW(assign_by_tilt({-20, 0, 20}, {20}, 1), Error);
}

// Assigns rows of rising tilts with these numbers, beside dark frames of which only the places are
// known. The tilts of dark frames are also those of rows, so that they tell nothing.
Sections assign_by_place(const Sections& numbers, const Sections& places) {
  AreTomoAlignment alignment;
  alignment.alpha_offset_deg = 4;
  for (const auto number : numbers) {
    alignment.rows.emplace_back();
    alignment.rows.back().section = number;
    alignment.rows.back().tilt_deg = 4.0 * static_cast<double>(alignment.rows.size());
  }
  for (const auto place : places) {
    alignment.dark_places.push_back(place);
    alignment.dark_sections.push_back(0);
    alignment.dark_tilt_deg.push_back(4.0 * static_cast<double>(place));
  }
  return assign_aretomo_sections(alignment, "a.aln", std::ssize(numbers) + std::ssize(places), "a");
}

TEST(AreTomoSections, DarkFramesWithoutSectionsAreFoundByPlace) {
  EXPECT_EQ(assign_by_place({1, 2, 4, 6}, {2, 4}), (Sections{0, 1, 3, 5}));
  EXPECT_EQ(assign_by_place({0, 1, 3, 5}, {2, 4}), (Sections{0, 1, 3, 5}));
  EXPECT_EQ(assign_by_place({1, 2, 3, 4}, {2, 4}), (Sections{0, 1, 3, 5}));  // after the removal
  EXPECT_EQ(assign_by_place({2, 3, 4}, {0}), (Sections{1, 2, 3}));
  EXPECT_THROW(assign_by_place({1, 2, 3, 4}, {2, 9}), Error);
}

TEST(AreTomoAlignment, NamesTheColumnThatCannotBe) {
  const ScratchDirectory scratch;
  const auto path =
      scratch.write("a.aln", aln_row(0) + "1 85 1.0 3.5 -2 1 1 1 0 1567301525373690.0\n");
  expect_parts(message_of<Error>([&] { read_aretomo_alignment(path); }),
               {"a.aln", "line 2", "TILT", "'1567301525373690.0'", "--tlt"});
  EXPECT_EQ(read_aretomo_alignment(path, /*needs_tilt=*/false).rows.size(), 2u);
  const auto shifted = scratch.write("b.aln", aln_row(0) + "1 85 1.0 3.5 1e30 1 1 1 0 10\n");
  expect_parts(message_of<Error>([&] { read_aretomo_alignment(shifted, false); }),
               {"b.aln", "line 2", "TY", "'1e30'"});
}

TEST(TiltTable, ReadsTheColumnsOfAreTomo3) {
  const ScratchDirectory scratch;
  const TiltTable table = read_tilt_table(scratch.write(
      "a_TLT.txt", "  -6.00     3      2.50\n   0.00     1      2.25\n   6.00     2      2.00\n"));
  ASSERT_EQ(table.angles.size(), 3u);
  EXPECT_EQ(table.angles[2].value, 6.0);
  EXPECT_EQ(table.angles[2].line, 3);
  EXPECT_EQ(table.order, (std::vector<std::size_t>{1, 2, 0}));
  EXPECT_EQ(table.doses, (std::vector<double>{2.5, 2.25, 2.0}));
  const TiltTable two = read_tilt_table(scratch.write("a.tlt", "-6 1\n0 0\n"));
  EXPECT_EQ(two.order, (std::vector<std::size_t>{1, 0}));
  EXPECT_TRUE(two.doses.empty());
  EXPECT_TRUE(read_tilt_table(scratch.write("a.tlt", "-6\n0\n")).order.empty());
  for (const char* bad :
       {"1 2\n3 4\n", "1 1\n3 1\n", "0 0.5\n1 1\n", "1 1 2\n1 2\n", "1 1 x\n2 2 1\n",
        "1 1 -3\n2 2 3\n", "1 1 3\n2 2 1e5\n", "1 2 3 4\n2 3 4 5\n"})
    expect_parts(message_of<Error>([&] { read_tilt_table(scratch.write("bad.tlt", bad)); }),
                 {"bad.tlt", "line "});
  expect_parts(message_of<Error>([&] { read_tilt_table(scratch.write("bad.tlt", "1 1\n3 1\n")); }),
               {"line 2", "has place 1"});
  expect_parts(message_of<Error>([&] { read_tilt_table(scratch.write("bad.tlt", "1 1\n3 4\n")); }),
               {"2 places run from 1 to 4"});
}

TEST(SectionList, IsWrittenAsItIsRead) {
  for (const char* text : {"1-3,40", "2", "1,2", "1-4,6,8-10", ""}) {
    std::vector<std::int64_t> sections = parse_section_list(text, 50);
    for (auto& section : sections) ++section;
    EXPECT_EQ(section_list(sections), text);
  }
}

TEST(AreTomoSections, NeverAssumes) {
  expect_parts(message_of<Error>([] {
                 assign({0, 1, 2}, {3}, 7);
               }),
               {"3", "1 dark", "7", "a.aln", "a.st"});
  EXPECT_THROW(assign({0, 2, 5}, {}, 3), Error);
  EXPECT_THROW(assign({0, 1, 1}, {}, 3), Error);
}

TEST(SectionList, NumbersAndRanges) {
  EXPECT_EQ(parse_section_list("1-3,40", 41), (Sections{0, 1, 2, 39}));
  EXPECT_EQ(parse_section_list(" 4 , 2 - 3,3", 4), (Sections{1, 2, 3}));
  EXPECT_TRUE(parse_section_list("", 4).empty());
  for (const char* bad : {"0", "5", "3-2", "a", "1-", "-2", "1,,2", "2-9", "1.5"}) {
    EXPECT_THROW(parse_section_list(bad, 4), Error) << bad;
  }
}

}  // namespace
}  // namespace tomofield::io
