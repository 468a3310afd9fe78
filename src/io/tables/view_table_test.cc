#include "io/tables/view_table.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "expect_parts.h"
#include "io/tables/ctf_table.h"
#include "io/tables/relion_star.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

std::string refusal_of_views(const std::filesystem::path& path) {
  return message_of<Error>([&] { read_view_table(path); });
}

const std::string kRelionHead =
    "\n# version 50001\n\ndata_TS_01\n\nloop_\n_rlnMicrographName #1\n_rlnMicrographNameEven #2\n"
    "_rlnTomoXTilt #3\n_rlnTomoYTilt #4\n_rlnTomoZRot #5\n_rlnTomoXShiftAngst #6\n"
    "_rlnTomoYShiftAngst #7\n_rlnMicrographPreExposure #8\n_rlnDefocusU #9\n_rlnDefocusV #10\n"
    "_rlnDefocusAngle #11\n_rlnPhaseShift #12\n";

TEST(ViewTable, ReadsATiltSeriesOfRelion) {
  const ScratchDirectory scratch;
  const auto path = scratch.write(
      "TS_01.star", kRelionHead +
                        "M/a.mrc M/a_EVN.mrc 0.5 -60.25 85.3 -13.5 7 3 40000 39000 -45 90\n"
                        "2@s.mrcs None 0.5 -57 85.3 0 0 0 40000 39000 -45 0\n");
  const ViewTable table = read_view_table(path);
  EXPECT_EQ(table.centre, CentreRule::kWholePixel);
  ASSERT_EQ(table.views.size(), 2u);
  const ListedView& view = table.views[0];
  EXPECT_EQ(view.image, "M/a.mrc");
  EXPECT_EQ(view.even, "M/a_EVN.mrc");
  EXPECT_EQ(view.odd, "");
  EXPECT_EQ(view.tilt_deg, -60.25);
  EXPECT_EQ(view.x_tilt_deg, 0.5);
  EXPECT_EQ(view.rotation_deg, 85.3);
  EXPECT_EQ(view.shift_x_A, -13.5);
  EXPECT_EQ(view.shift_y_A, 7.0);
  EXPECT_EQ(view.dose_before, 3.0);
  ASSERT_TRUE(view.defocus);
  EXPECT_EQ(view.defocus->u_A, 40000.0);
  EXPECT_EQ(view.defocus->v_A, 39000.0);
  EXPECT_EQ(view.defocus->angle_deg, -45.0);
  EXPECT_EQ(view.defocus->phase_shift_deg, 90.0);
  EXPECT_EQ(table.views[1].even, "");
}

TEST(ViewTable, RefusesViewsOfRelionThatAreIncomplete) {
  const ScratchDirectory scratch;
  expect_parts(
      refusal_of_views(scratch.write("a.star", "data_t\nloop_\n_rlnMicrographName #1\na.mrc\n")),
      {"a.star", "rlnTomoYTilt", "not aligned"});
  expect_parts(refusal_of_views(scratch.write("a.star", "data_t\nloop_\n_rlnX #1\n1\n")),
               {"rlnMicrographName"});
  expect_parts(
      refusal_of_views(scratch.write("a.star", kRelionHead + "a.mrc None 0 400 0 0 0 0 0 0 0 0\n")),
      {"row 1", "400", "rlnTomoYTilt"});
  expect_parts(refusal_of_views(scratch.write("a.star", kRelionHead)), {"lists no views"});
}

TEST(ViewTable, RefusesTablesOfRelionThatContradictThemselves) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& more) {
    std::string head = kRelionHead;
    return refusal_of_views(scratch.write("a.star", head + more));
  };
  const std::string row = "a.mrc None 0 4 0 0 0 0 3e4 3e4 0 0";
  expect_parts(refusal("_rlnVoltage #13\n" + row + " 300\n" + row + " 200\n"),
               {"a.star", "rlnVoltage", "row 2"});
  expect_parts(refusal("_rlnAmplitudeContrast #13\n" + row + " 7\n"), {"a.star", "contrast of 7"});
  expect_parts(refusal(row + "\n\ndata_more\nloop_\n_rlnMicrographName #1\nb.mrc\n"),
               {"a.star", "several tables", "rlnMicrographName"});
}

TEST(RelionTomograms, AreReadWithTheirColumns) {
  const ScratchDirectory scratch;
  const auto path = scratch.write(
      "tomograms.star",
      "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n_rlnTomoHand #3\n"
      "_rlnTomoTiltSeriesPixelSize #4\n_rlnTomoSizeX #5\n_rlnTomoSizeY #6\n_rlnTomoSizeZ #7\n"
      "_rlnAmplitudeContrast #8\nTS_01 t/TS_01.star -1.0 2.39 4092 4000 1392 0.1\n"
      "TS_02 t/TS_02.star -1.0 2.39 4092 4000 None 0.1\n");
  EXPECT_TRUE(lists_tomograms(path));
  const RelionTomograms all = read_relion_tomograms(path);
  ASSERT_EQ(all.tomograms.size(), 2u);
  EXPECT_EQ(all.tomograms[0].name, "TS_01");
  EXPECT_EQ(all.tomograms[0].tilt_series_star, "t/TS_01.star");
  EXPECT_EQ(all.tomograms[0].pixel_size_A, 2.39);
  EXPECT_EQ(all.tomograms[0].defocus_hand, 1);
  EXPECT_EQ(all.tomograms[0].optics.amplitude_contrast, 0.1);
  EXPECT_EQ(all.tomograms[0].optics.voltage_kV, std::nullopt);
  EXPECT_EQ(all.tomograms[0].size_px, (std::array<std::int64_t, 3>{4092, 4000, 1392}));
  EXPECT_EQ(all.tomograms[1].size_px, std::nullopt);
  EXPECT_EQ(all.table.columns().size(), 8u);
  const auto two_tables =
      scratch.write("two.star",
                    "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n"
                    "_rlnVoltage #3\na a.star 300\n\ndata_optics\nloop_\n_rlnVoltage #1\n200\n");
  expect_parts(message_of<Error>([&] { read_relion_tomograms(two_tables); }),
               {"two.star", "_rlnVoltage", "data_optics", "data_global"});
  const auto views = scratch.write("TS_01.star", kRelionHead);
  EXPECT_FALSE(lists_tomograms(views));
  expect_parts(message_of<Error>([&] { read_relion_tomograms(views); }),
               {"TS_01.star", "rlnTomoTiltSeriesStarFile"});
}

// RELION writes three zeros for tomograms that are not reconstructed yet.
TEST(RelionTomograms, HaveSizesOfWholePixelsOrNone) {
  const ScratchDirectory scratch;
  const auto size_of = [&](const std::string& size) {
    const auto path = scratch.write(
        "tomograms.star",
        "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n_rlnTomoSizeX #3\n"
        "_rlnTomoSizeY #4\n_rlnTomoSizeZ #5\nTS_01 t/TS_01.star " +
            size + "\n");
    return read_relion_tomograms(path).tomograms[0].size_px;
  };
  EXPECT_EQ(size_of("0 0 0"), std::nullopt);
  EXPECT_EQ(size_of("64 48 24.0"), (std::array<std::int64_t, 3>{64, 48, 24}));
  for (const auto& [size, column] : {std::pair("64 48 -5", "rlnTomoSizeZ"),
                                     {"64 48 0", "rlnTomoSizeZ"},
                                     {"64 48 2.5", "rlnTomoSizeZ"},
                                     {"-64 48 20", "rlnTomoSizeX"},
                                     {"64 0.5 20", "rlnTomoSizeY"}})
    expect_parts(message_of<Error>([&, size = size] { size_of(size); }),
                 {"tomograms.star", "TS_01", column});
}

TEST(RelionTomograms, AHeightAloneIsNoted) {
  const ScratchDirectory scratch;
  const RelionTomograms all = read_relion_tomograms(scratch.write(
      "tomograms.star",
      "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n_rlnTomoSizeZ #3\n"
      "TS_01 t/TS_01.star 1200\nTS_02 t/TS_02.star 0\n"));
  ASSERT_EQ(all.tomograms[0].not_applied.size(), 1u);
  expect_parts(all.tomograms[0].not_applied[0], {"rlnTomoSizeZ", "rlnTomoSizeX"});
  EXPECT_TRUE(all.tomograms[1].not_applied.empty());
}

TEST(ViewTable, ADefocusThatIsLeftOutIsNoted) {
  const ScratchDirectory scratch;
  const std::string row = " None 0 -60 85 0 0 3 ";
  const auto view_table = [&](const std::string& defocus) {
    return read_view_table(scratch.write(
        "TS.star", kRelionHead + "a.mrc" + row + "4 4 45 0\nb.mrc" + row + defocus + "\n"));
  };
  EXPECT_TRUE(has_defocus(view_table("4 4 45 0")));
  EXPECT_TRUE(view_table("4 4 45 0").ctf_not_applied.empty());
  for (const char* gap : {"None 4 45 0", "4 None 45 0", "4 4 <NA> 0"}) {
    const ViewTable table = view_table(gap);
    EXPECT_FALSE(has_defocus(table)) << gap;
    ASSERT_EQ(table.ctf_not_applied.size(), 1u) << gap;
    expect_parts(table.ctf_not_applied[0], {"no complete defocus", "row 2"});
  }
}

TEST(ViewTable, DeformationsOfRelionAreNoted) {
  const ScratchDirectory scratch;
  const auto noted = [&](const std::string& coefficients) {
    return read_view_table(
               scratch.write("TS.star",
                             "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot "
                             "#3\n_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst "
                             "#5\n_rlnTomoDeformationCoefficients #6\na.mrc 0 0 0 0 " +
                                 coefficients + "\n"))
        .not_applied;
  };
  EXPECT_TRUE(noted("[0,0,0,0]").empty());
  ASSERT_EQ(noted("[0,0.5,0,0]").size(), 1u);
  expect_parts(noted("[0,0.5,0,0]")[0], {"rlnTomoDeformationCoefficients"});
}

TEST(ViewTable, OpticsOfRelionThatAreNotAppliedAreNoted) {
  const ScratchDirectory scratch;
  const auto noted = [&](const std::string& column, const std::string& value) {
    return read_view_table(
               scratch.write("TS.star",
                             "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot "
                             "#3\n_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n_" +
                                 column + " #6\na.mrc 0 0 0 0 " + value + "\n"))
        .not_applied;
  };
  for (const auto& [column, neutral, other] :
       {std::tuple("rlnMagMat00", "1.0", "1.02"),
        {"rlnMagMat01", "0.0", "0.01"},
        {"rlnBeamTiltX", "0", "-0.3"},
        {"rlnMagMat00", "1", "nan"},
        {"rlnMagMat10", "0e0", "abc"},
        {"rlnBeamTiltY", "None", "nan"},
        {"rlnTomoDeformationCoefficients", "[0,0]", "[nan,nan]"},
        {"rlnOddZernike", "[0,0]", "[0,0.2]"}}) {
    EXPECT_TRUE(noted(column, neutral).empty()) << column;
    ASSERT_EQ(noted(column, other).size(), 1u) << column;
    expect_parts(noted(column, other)[0], {column});
  }
  // The row of a tomogram, and a table of the contrast transfer alone, may state them, too.
  const auto tomograms = scratch.write(
      "tomograms.star",
      "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n_rlnMagMat00 #3\n"
      "TS_01 a.star 1\nTS_02 b.star 2\n");
  const RelionTomograms all = read_relion_tomograms(tomograms);
  EXPECT_TRUE(all.tomograms[0].not_applied.empty());
  ASSERT_EQ(all.tomograms[1].not_applied.size(), 1u);
  const auto ctf = read_ctf(
      scratch.write("ctf.star", "data_t\nloop_\n_rlnDefocusU #1\n_rlnBeamTiltX #2\n30000 0.5\n"));
  ASSERT_EQ(ctf.not_applied.size(), 1u);
  expect_parts(ctf.not_applied[0], {"rlnBeamTiltX"});
}

TEST(ViewTable, TablesOfOtherJobsOfRelionAreNamed) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& column) {
    return refusal_of_views(scratch.write("TS.star", "data_t\nloop_\n_" + column + " #1\na.eer\n"));
  };
  expect_parts(refusal("rlnMicrographMovieName"), {"TS.star", "Import", "Motion correction"});
  expect_parts(refusal("rlnTomoTomogramsFile"), {"TS.star", "optimisation set", "tomograms.star"});
}

TEST(ViewTable, RefusesTextInPlaceOfANumber) {
  const ScratchDirectory scratch;
  const std::vector<std::string> good{"a.mrc", "None", "0", "-60", "85", "0",
                                      "0",     "3",    "4", "4",   "45", "0"};
  const std::vector<std::string> names{"rlnTomoXTilt",       "rlnTomoYTilt",
                                       "rlnTomoZRot",        "rlnTomoXShiftAngst",
                                       "rlnTomoYShiftAngst", "rlnMicrographPreExposure",
                                       "rlnDefocusU",        "rlnDefocusV",
                                       "rlnDefocusAngle",    "rlnPhaseShift"};
  const auto refusal = [&](const std::vector<std::string>& words) {
    std::string row;
    for (const std::string& word : words) row += word + " ";
    return refusal_of_views(scratch.write("TS.star", kRelionHead + row + "\n"));
  };
  EXPECT_EQ(refusal(good), "");
  for (std::size_t i = 0; i < names.size(); ++i) {
    const bool may_be_absent = names[i].starts_with("rlnDefocus") || names[i] == "rlnPhaseShift";
    for (const char* bad : {"None", "many"}) {
      std::vector<std::string> words = good;
      words[i + 2] = bad;
      if (may_be_absent && std::string_view(bad) == "None")
        EXPECT_EQ(refusal(words), "") << names[i];
      else
        expect_parts(refusal(words), {"TS.star", "row 1", names[i], bad});
    }
  }
}

TEST(ViewTable, HasTheHandThatRelionsTableOfViewsStates) {
  const ScratchDirectory scratch;
  const auto table = [&](const std::string& hand) {
    return read_view_table(
        scratch.write("TS.star",
                      "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot #3\n"
                      "_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n_rlnTomoHand #6\n"
                      "a.mrc 0 0 0 0 " +
                          hand + "\n"));
  };
  EXPECT_EQ(table("-1").defocus_hand, 1);
  EXPECT_EQ(table("1").defocus_hand, -1);
  expect_parts(message_of<Error>([&] { table("2"); }), {"TS.star", "rlnTomoHand is 2"});
}

TEST(ViewTable, RefusesADoseBelowZero) {
  const ScratchDirectory scratch;
  expect_parts(refusal_of_views(scratch.write(
                   "TS.star", kRelionHead + "a.mrc None 0 -60 85 0 0 -3 40000 39000 -45 0\n")),
               {"TS.star", "row 1", "-3", "rlnMicrographPreExposure"});
}

TEST(ViewTable, RefusesAnImageOfTwoViews) {
  const ScratchDirectory scratch;
  const std::string row = "a.mrc None 0 4 0 0 0 0 3e4 3e4 0 0\n";
  expect_parts(refusal_of_views(scratch.write("a.star", kRelionHead + row + row)),
               {"a.star", "a.mrc", "two views"});
}

TEST(ViewTable, NamesColumnsThatAreNotKnown) {
  const ScratchDirectory scratch;
  const auto remarks = [&](const std::string& columns, const std::string& values) {
    return read_view_table(
               scratch.write("TS.star",
                             "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n"
                             "_rlnTomoZRot #3\n_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n" +
                                 columns + "a.mrc 0 0 0 0 " + values + "\n"))
        .remarks;
  };
  EXPECT_TRUE(remarks("_rlnCtfMaxResolution #6\n_RLNACCUMMOTIONTOTAL #7\n", "5 3").empty());
  EXPECT_TRUE(remarks("_rlnCtfScalefactor #6\n", "0").empty());  // states nothing
  const auto found = remarks("_rlnCtfScalefactor #6\n_quality #7\n", "0.8 bad");
  ASSERT_EQ(found.size(), 1u);
  expect_parts(found[0], {"does not know _rlnCtfScalefactor, _quality", "have no effect"});
  std::string columns, values;
  for (int i = 0; i < 9; ++i) {
    columns += fmt::format("_new{} #{}\n", i, 6 + i);
    values += "1 ";
  }
  expect_parts(remarks(columns, values).at(0), {"_new7, …"});
}

TEST(RelionTomograms, NameColumnsThatAreNotKnown) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& column) {
    return read_relion_tomograms(
               scratch.write(
                   "tomograms.star",
                   "data_global\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n" + column +
                       " #3\nTS_01 a.star 7\n"))
        .remark;
  };
  EXPECT_FALSE(read("_rlnTomoTomogramBinning"));
  expect_parts(read("_rlnTomoPitch").value_or(""), {"_rlnTomoPitch", "has no effect"});
}

TEST(ViewTable, CentresAreThoseOfThePrograms) {
  EXPECT_EQ(distance_from_middle_px(CentreRule::kWholePixel, 8), 0.5);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kWholePixel, 9), 0.0);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kHalfSize, 8), 0.5);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kHalfSize, 9), 0.5);
}

}  // namespace
}  // namespace tomofield::io
