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
  expect_parts(refusal_of_views(scratch.write("TS.tomostar",
                                              "\ndata_\n\nloop_\n_wrpMovieName #1\n"
                                              "_wrpAngleTilt #2\n_wrpDose #3\na.eer 45 None\n")),
               {"TS.tomostar", "row 1", "wrpDose"});
}

TEST(ViewTable, ReadsATomostarWithTheSignsOfWarp) {
  const ScratchDirectory scratch;
  const std::string head =
      "\ndata_\n\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n_wrpAxisAngle #3\n_wrpDose #4\n";
  const ViewTable table = read_view_table(scratch.write(
      "a.tomostar", head + "_wrpAxisOffsetX #5\n_wrpAxisOffsetY #6\n"
                           "  ../frames/a_031_-45.00.eer   45.01  83.94 116.1 3 -4\n"));
  EXPECT_EQ(table.centre, CentreRule::kHalfSize);
  ASSERT_EQ(table.views.size(), 1u);
  EXPECT_EQ(table.views[0].image, "../frames/a_031_-45.00.eer");
  EXPECT_EQ(table.views[0].tilt_deg, -45.01);
  EXPECT_EQ(table.views[0].rotation_deg, 83.94);
  EXPECT_EQ(table.views[0].shift_x_A, 3.0);
  EXPECT_EQ(table.views[0].shift_y_A, -4.0);
  EXPECT_EQ(table.views[0].dose_before, 116.1);
  EXPECT_TRUE(table.not_applied.empty());
  const auto without = read_view_table(scratch.write("b.tomostar", head + "a.eer 1 2 3\n"));
  ASSERT_EQ(without.remarks.size(), 1u);
  expect_parts(without.remarks[0], {"shifts"});
}

const std::string kSeriesXml =
    "<TiltSeries LevelAngleX=\"0.5\" LevelAngleY=\"-1\" AreAnglesInverted=\"True\">\n"
    "\t<Angles>-60\n-57.5</Angles>\n\t<Dose>3\n0</Dose>\n\t<UseTilt>True\nFalse</UseTilt>\n"
    "\t<AxisAngle>-4.3\n-4.3</AxisAngle>\n\t<AxisOffsetX>271.8\n1</AxisOffsetX>\n"
    "\t<AxisOffsetY>1.5\n2</AxisOffsetY>\n\t<MoviePath>../2/a.tif\n../2/b.tif</MoviePath>\n";

std::string grid(const std::string& name, const std::string& shape, const std::string& nodes) {
  return "<" + name + " " + shape + ">" + nodes + "</" + name + ">\n";
}

TEST(ViewTable, ReadsTheXmlOfWarp) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("TS.xml", kSeriesXml + "</TiltSeries>");
  const ViewTable table = read_view_table(path);
  ASSERT_EQ(table.views.size(), 2u);
  EXPECT_EQ(table.views[0].image, "../2/a.tif");
  EXPECT_EQ(table.views[0].tilt_deg, 61.0);
  EXPECT_EQ(table.views[0].x_tilt_deg, 0.5);
  EXPECT_EQ(table.views[0].rotation_deg, -4.3);
  EXPECT_EQ(table.views[0].shift_x_A, 271.8);
  EXPECT_EQ(table.views[1].shift_y_A, 2.0);
  EXPECT_EQ(table.views[0].dose_before, 3.0);
  EXPECT_TRUE(table.views[0].is_used);
  EXPECT_FALSE(table.views[1].is_used);
  EXPECT_TRUE(table.not_applied.empty());
  EXPECT_EQ(table.defocus_hand, 1);
}

TEST(ViewTable, NamesPixelsOfWarpThatAreNotSquare) {
  const ScratchDirectory scratch;
  const auto with = [&](const std::string& parameters) {
    return scratch.write("TS.xml", kSeriesXml + "<CTF>" + parameters + "</CTF></TiltSeries>");
  };
  const ViewTable table = read_view_table(
      with("<Param Name=\"PixelSize\" Value=\"10\"/><Param Name=\"PixelSizeDelta\" Value=\"2\"/>"));
  ASSERT_EQ(table.not_applied.size(), 1u);
  expect_parts(table.not_applied[0], {"PixelSizeDelta", "not square"});
  for (const char* size : {"-1", "0", "nan", "abc"})
    expect_parts(
        refusal_of_views(with("<Param Name=\"PixelSize\" Value=\"" + std::string(size) + "\"/>")),
        {"TS.xml", "PixelSize"});
}

TEST(ViewTable, RefusesADoseBelowZero) {
  const ScratchDirectory scratch;
  expect_parts(refusal_of_views(scratch.write(
                   "TS.star", kRelionHead + "a.mrc None 0 -60 85 0 0 -3 40000 39000 -45 0\n")),
               {"TS.star", "row 1", "-3", "rlnMicrographPreExposure"});
  expect_parts(
      refusal_of_views(scratch.write("TS.tomostar",
                                     "\ndata_\n\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n"
                                     "_wrpDose #3\na.eer 45 3\nb.eer 42 -4.5\n")),
      {"TS.tomostar", "row 2", "-4.5", "wrpDose"});
  std::string xml = kSeriesXml + "</TiltSeries>";
  xml.replace(xml.find("3\n0</Dose>"), 1, "-3");
  expect_parts(refusal_of_views(scratch.write("TS.xml", xml)), {"TS.xml", "-3", "view 1"});
}

TEST(ViewTable, KnowsTheHandOfTheDefocusOfWarp) {
  const ScratchDirectory scratch;
  const auto hand = [&](const std::string& attribute) {
    return read_view_table(scratch.write("TS.xml", "<TiltSeries" + attribute +
                                                       "><Angles>-60</Angles>\n<MoviePath>a.tif"
                                                       "</MoviePath></TiltSeries>"))
        .defocus_hand;
  };
  EXPECT_EQ(hand(" AreAnglesInverted=\"True\""), 1);
  EXPECT_EQ(hand(" AreAnglesInverted=\"False\""), -1);
  EXPECT_EQ(hand(""), std::nullopt);
}

TEST(ViewTable, RefusesFlagsAndSizesOfWarpThatCannotBe) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string xml = kSeriesXml + "</TiltSeries>";
    xml.replace(xml.find(from), from.size(), to);
    return refusal_of_views(scratch.write("TS.xml", xml));
  };
  const std::string inverted = "AreAnglesInverted=\"True\"", used = "True\nFalse";
  EXPECT_EQ(refusal(inverted, "AreAnglesInverted=\"true\""), "");
  EXPECT_EQ(refusal(used, "TRUE\nfalse"), "");
  expect_parts(refusal(inverted, "AreAnglesInverted=\"yes\""),
               {"TS.xml", "yes", "AreAnglesInverted"});
  expect_parts(refusal(used, "True\n0"), {"TS.xml", "'0'", "UseTilt", "view 2"});
  const auto sizes = [&](const std::string& attribute) {
    return refusal(inverted, attribute + " " + inverted);
  };
  EXPECT_EQ(sizes("VolumeDimensionsAngstrom=\"640, 480, 240\""), "");
  EXPECT_EQ(sizes("ImageDimensionsAngstrom=\"0, 0\" VolumeDimensionsAngstrom=\"0, 0, 0\""), "");
  for (const char* bad : {"640, 480, 0", "640, 480, -240", "0, 480, 240", "640, 480", "240"})
    expect_parts(sizes(fmt::format("VolumeDimensionsAngstrom=\"{}\"", bad)),
                 {"TS.xml", bad, "VolumeDimensionsAngstrom"});
  expect_parts(sizes("ImageDimensionsAngstrom=\"640, -480\""),
               {"TS.xml", "ImageDimensionsAngstrom"});
}

TEST(ViewTable, ReadsXmlInUtf16) {
  const ScratchDirectory scratch;
  std::string utf16 = "\xFF\xFE";
  for (const char c :
       "<?xml version=\"1.0\" encoding=\"utf-16\"?>\n" + kSeriesXml + "</TiltSeries>")
    utf16 += {c, '\0'};
  EXPECT_EQ(read_view_table(scratch.write("TS.xml", utf16)).views[0].tilt_deg, 61.0);
}

TEST(ViewTable, SubtractsTheMeanMovementOfWarpAndNamesTheRest) {
  const ScratchDirectory scratch;
  const std::string rigid =
      grid("GridMovementX", "Width=\"1\" Height=\"1\" Depth=\"2\"",
           "<Node X=\"0\" Y=\"0\" Z=\"0\" Value=\"1\"/><Node X=\"0\" Y=\"0\" Z=\"1\" "
           "Value=\"2\"/>") +
      grid("GridMovementY", "Width=\"1\" Height=\"1\" Depth=\"1\"", "<Node Value=\"0.5\"/>");
  const auto moved = read_view_table(scratch.write("a.xml", kSeriesXml + rigid + "</TiltSeries>"));
  EXPECT_DOUBLE_EQ(moved.views[0].shift_x_A, 270.8);
  EXPECT_DOUBLE_EQ(moved.views[1].shift_x_A, -1.0);
  EXPECT_DOUBLE_EQ(moved.views[1].shift_y_A, 1.5);
  // Outer nodes lie on the edges of a view, so they count half: (1 / 2 + 4 + 3 / 2) / 2.
  const std::string local =
      grid("GridMovementX", "Width=\"3\" Height=\"1\" Depth=\"1\"",
           "<Node X=\"0\" Z=\"0\" Value=\"1\"/><Node X=\"1\" Z=\"0\" Value=\"4\"/>"
           "<Node X=\"2\" Z=\"0\" Value=\"3\"/>") +
      grid("GridVolumeWarpZ", "Width=\"1\"", "<Node Value=\"3\"/>");
  const auto left = read_view_table(scratch.write("b.xml", kSeriesXml + local + "</TiltSeries>"));
  EXPECT_DOUBLE_EQ(left.views[0].shift_x_A, 271.8 - 3.0);
  ASSERT_EQ(left.not_applied.size(), 2u);
  expect_parts(left.not_applied[0], {"GridMovementX", "mean", "by up to 2 Å"});
  expect_parts(left.not_applied[1], {"GridVolumeWarpZ"});
}

TEST(ViewTable, TakesTheMeanDefocusOfWarpsGridsAndNamesTheRest) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& grids) {
    return read_view_table(scratch.write("a.xml", kSeriesXml + grids + "</TiltSeries>"));
  };
  const auto node = [](int x, int z, double value) {
    return fmt::format("<Node X=\"{}\" Z=\"{}\" Value=\"{}\"/>", x, z, value);
  };
  const std::string defocus = grid("GridCTF", "Width=\"2\" Height=\"1\" Depth=\"2\"",
                                   node(0, 0, 2) + node(1, 0, 4) + node(0, 1, 5) + node(1, 1, 5));
  const auto found = read(defocus + grid("GridCTFDefocusDelta", "", "<Node Value=\"1\"/>"));
  ASSERT_TRUE(found.views[0].defocus && found.views[1].defocus);
  EXPECT_DOUBLE_EQ(found.views[0].defocus->u_A, 35000);
  EXPECT_DOUBLE_EQ(found.views[1].defocus->v_A, 45000);
  ASSERT_EQ(found.ctf_not_applied.size(), 1u);
  expect_parts(found.ctf_not_applied[0], {"GridCTF", "by up to 1 µm"});
  const auto other = read(
      defocus + grid("GridCTFPhase", "Depth=\"3\"", node(0, 0, 1) + node(0, 1, 1) + node(0, 2, 1)));
  EXPECT_FALSE(other.views[0].defocus);
  ASSERT_EQ(other.ctf_not_applied.size(), 2u);
  expect_parts(other.ctf_not_applied[1], {"GridCTFPhase", "2"});
  for (const char* name : {"GridAngleX", "GridDoseWeights"}) {
    const auto noted = read(grid(name, "", "<Node Value=\"3\"/>"));
    ASSERT_EQ(noted.not_applied.size(), 1u);
    expect_parts(noted.not_applied[0], {name});
  }
  EXPECT_TRUE(read(grid("GridDoseWeights", "", "<Node Value=\"1\"/>")).not_applied.empty());
}

TEST(ViewTable, RefusesGridsAndElementsOfWarpThatContradictThemselves) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& more) {
    return refusal_of_views(scratch.write("a.xml", kSeriesXml + more + "</TiltSeries>"));
  };
  const std::string node = "<Node Z=\"0\" Value=\"3\"/>", later = "<Node Z=\"1\" Value=\"3\"/>";
  const std::string rigid = grid("GridCTF", "Depth=\"2\"", node + later);
  EXPECT_EQ(refusal(rigid), "");
  expect_parts(refusal(rigid + rigid), {"a.xml", "<GridCTF>", "twice"});
  expect_parts(refusal("<Angles>1\n2</Angles>"), {"a.xml", "<Angles>", "twice"});
  expect_parts(refusal(grid("GridCTF", "Depth=\"2\"", node + node)), {"GridCTF", "Z=0", "twice"});
  expect_parts(refusal(grid("GridCTF", "Depth=\"2\"", node)), {"GridCTF", "1 nodes"});
  expect_parts(refusal(grid("GridCTF", "Depth=\"1\"", later)), {"GridCTF", "Z=\"1\""});
  expect_parts(refusal(grid("GridCTF", "Width=\"abc\"", node)), {"GridCTF", "Width", "abc"});
  const auto param = [](const char* name, const char* value) {
    return fmt::format("<Param Name=\"{}\" Value=\"{}\"/>", name, value);
  };
  const auto ctf = [](const std::string& params) { return "<CTF>" + params + "</CTF>"; };
  expect_parts(refusal(ctf(param("Cs", "2.7") + param("Cs", "2"))), {"Cs", "twice"});
  for (const auto& [name, value] :
       {std::pair{"Voltage", "300000"}, {"Voltage", "0"}, {"Cs", "-2.7"}, {"Amplitude", "7"}})
    expect_parts(refusal(ctf(param(name, value))), {"a.xml", value});
}

TEST(ViewTable, NamesImagesThatAreStretchedOrListedTwice) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& matrix) {
    std::string text = kSeriesXml + "</TiltSeries>";
    text.insert(text.find(" LevelAngleX"), " MagnificationCorrection=\"" + matrix + "\"");
    return read_view_table(scratch.write("a.xml", text));
  };
  for (const char* unit : {"1, 0, 0, 1", "1.0, 0.0, 0, 1.00"})
    EXPECT_TRUE(read(unit).not_applied.empty()) << unit;
  ASSERT_EQ(read("1.05, 0, 0, 0.95").not_applied.size(), 1u);
  expect_parts(read("1.05, 0, 0, 0.95").not_applied[0], {"MagnificationCorrection"});
  const std::string row = "a.mrc None 0 4 0 0 0 0 3e4 3e4 0 0\n";
  expect_parts(refusal_of_views(scratch.write("a.star", kRelionHead + row + row)),
               {"a.star", "a.mrc", "two views"});
}

TEST(ViewTable, RefusesXmlThatStatesSomethingTwice) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string xml = kSeriesXml + "</TiltSeries>";
    xml.replace(xml.find(from), from.size(), to);
    return refusal_of_views(scratch.write("TS.xml", xml));
  };
  expect_parts(refusal("LevelAngleX=\"0.5\"", "LevelAngleX=\"0.5\" LevelAngleX=\"50\""),
               {"TS.xml", "LevelAngleX of <TiltSeries>", "twice"});
  expect_parts(refusal("</TiltSeries>", "</TiltSeries><TiltSeries></TiltSeries>"),
               {"TS.xml", "<TiltSeries>", "twice"});
}

TEST(ViewTable, NamesAberrationsOfWarpAndKeepsItsTilts) {
  const ScratchDirectory scratch;
  const auto with = [&](const std::string& value) {
    return scratch.write("TS.xml", kSeriesXml + grid("GridCTF", "", "<Node Value=\"3\"/>") +
                                       "<CTF><Param Name=\"BeamTilt\" Value=\"" + value +
                                       "\"/></CTF></TiltSeries>");
  };
  EXPECT_TRUE(read_view_table(with("(0, 0)")).ctf_not_applied.empty());
  const CtfTable ctf = read_ctf(with("(3, 2)"));
  ASSERT_EQ(ctf.not_applied.size(), 1u);
  expect_parts(ctf.not_applied[0], {"aberrations", "BeamTilt"});
  ASSERT_EQ(ctf.tilt_deg.size(), 2u);  // as IMOD has them
  EXPECT_EQ(ctf.tilt_deg[0], 61.0);
}

TEST(ViewTable, RefusesAnglesOfWarpsDefocusBeyondATurn) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& name, const std::string& value) {
    const std::string nodes = "<Node Value=\"" + value + "\"/>";
    return refusal_of_views(scratch.write("TS.xml", kSeriesXml +
                                                        grid("GridCTF", "", "<Node Value=\"3\"/>") +
                                                        grid(name, "", nodes) + "</TiltSeries>"));
  };
  EXPECT_EQ(refusal("GridCTFPhase", "0.5"), "");
  EXPECT_EQ(refusal("GridCTFDefocusAngle", "170"), "");
  expect_parts(refusal("GridCTFPhase", "90"), {"TS.xml", "view 1", "16200"});
  expect_parts(refusal("GridCTFDefocusAngle", "9000"), {"TS.xml", "view 1", "9000"});
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

TEST(ViewTable, RefusesXmlThatIsNoSeries) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    return refusal_of_views(scratch.write("a.xml", text));
  };
  expect_parts(refusal("<TiltSeries><Angles>1"), {"a.xml", "no XML file"});
  expect_parts(refusal("<Movie/>"), {"a.xml", "no tilt series"});
  expect_parts(refusal(kSeriesXml + "<Angles>3</Angles></TiltSerie>"), {"a.xml"});
  std::string bad = kSeriesXml + "</TiltSeries>";
  bad.replace(bad.find("-57.5"), 5, "tilt");
  expect_parts(refusal(bad), {"a.xml", "'tilt'", "Angles"});
  bad = kSeriesXml + "</TiltSeries>";
  bad.replace(bad.find("\n-4.3<"), 5, "");
  expect_parts(refusal(bad), {"AxisAngle", "1", "2"});
}

TEST(ViewTable, CentresAreThoseOfThePrograms) {
  EXPECT_EQ(distance_from_middle_px(CentreRule::kWholePixel, 8), 0.5);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kWholePixel, 9), 0.0);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kHalfSize, 8), 0.5);
  EXPECT_EQ(distance_from_middle_px(CentreRule::kHalfSize, 9), 0.5);
}

}  // namespace
}  // namespace tomofield::io
