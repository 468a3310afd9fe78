#include <fmt/format.h>
#include <gtest/gtest.h>

#include "expect_parts.h"
#include "io/tables/ctf_table.h"
#include "io/tables/view_table.h"
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

TEST(WarpViews, RefusesATomostarWithoutADose) {
  const ScratchDirectory scratch;
  expect_parts(refusal_of_views(scratch.write("TS.tomostar",
                                              "\ndata_\n\nloop_\n_wrpMovieName #1\n"
                                              "_wrpAngleTilt #2\n_wrpDose #3\na.eer 45 None\n")),
               {"TS.tomostar", "row 1", "wrpDose"});
}

TEST(WarpViews, ReadsATomostarWithTheSignsOfWarp) {
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

TEST(WarpViews, ReadsTheXmlOfWarp) {
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

TEST(WarpViews, NamesPixelsOfWarpThatAreNotSquare) {
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

TEST(WarpViews, RefusesADoseBelowZero) {
  const ScratchDirectory scratch;
  expect_parts(
      refusal_of_views(scratch.write("TS.tomostar",
                                     "\ndata_\n\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n"
                                     "_wrpDose #3\na.eer 45 3\nb.eer 42 -4.5\n")),
      {"TS.tomostar", "row 2", "-4.5", "wrpDose"});
  std::string xml = kSeriesXml + "</TiltSeries>";
  xml.replace(xml.find("3\n0</Dose>"), 1, "-3");
  expect_parts(refusal_of_views(scratch.write("TS.xml", xml)), {"TS.xml", "-3", "view 1"});
}

TEST(WarpViews, KnowsTheHandOfTheDefocusOfWarp) {
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

TEST(WarpViews, RefusesFlagsAndSizesOfWarpThatCannotBe) {
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

TEST(WarpViews, NamesWhatIsNotKnown) {
  const ScratchDirectory scratch;
  const auto remarks = [&](const std::string& attribute, const std::string& element) {
    std::string text = kSeriesXml + element + "</TiltSeries>";
    text.insert(text.find(" LevelAngleX"), attribute);
    return read_view_table(scratch.write("a.xml", text)).remarks;
  };
  EXPECT_TRUE(remarks(" Bfactor=\"3\" UnselectManual=\"False\"", "<TiltPS1D/><TiltPS1D/>").empty());
  EXPECT_TRUE(remarks(" UnselectManual=\"\"", "<OptionsCTF/><GridAngleX/>").empty());
  expect_parts(
      remarks(" LevelAngleZ=\"3\"", "<AxisShift>1</AxisShift><AxisShift>2</AxisShift>").at(0),
      {"does not know <AxisShift>, LevelAngleZ"});
  expect_parts(remarks(" UnselectManual=\"True\"", "").at(0), {"not selected in Warp"});
  const auto tomostar = [&](const std::string& column) {
    return read_view_table(scratch.write("a.tomostar",
                                         "data_\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n"
                                         "_wrpAxisOffsetX #3\n" +
                                             column + " #4\na.eer 1 2 3\n"))
        .remarks;
  };
  EXPECT_TRUE(tomostar("_wrpMaskedFraction").empty());
  expect_parts(tomostar("_wrpPitch").at(0), {"_wrpPitch", "has no effect"});
}

TEST(WarpViews, ReadsXmlInUtf16) {
  const ScratchDirectory scratch;
  std::string utf16 = "\xFF\xFE";
  for (const char c :
       "<?xml version=\"1.0\" encoding=\"utf-16\"?>\n" + kSeriesXml + "</TiltSeries>")
    utf16 += {c, '\0'};
  EXPECT_EQ(read_view_table(scratch.write("TS.xml", utf16)).views[0].tilt_deg, 61.0);
}

TEST(WarpViews, SubtractsTheMeanMovementOfWarpAndNamesTheRest) {
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

TEST(WarpViews, TakesTheMeanDefocusOfWarpsGridsAndNamesTheRest) {
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

TEST(WarpViews, RefusesGridsAndElementsOfWarpThatContradictThemselves) {
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

TEST(WarpViews, NamesImagesThatAreStretched) {
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
}

TEST(WarpViews, RefusesXmlThatStatesSomethingTwice) {
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

TEST(WarpViews, NamesAberrationsOfWarpAndKeepsItsTilts) {
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

TEST(WarpViews, RefusesAnglesOfWarpsDefocusBeyondATurn) {
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

TEST(WarpViews, RefusesXmlThatIsNoSeries) {
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

}  // namespace
}  // namespace tomofield::io
