#include "io/tables/ctf_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "expect_parts.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

void expect_defocus(const std::optional<Defocus>& defocus, double u_A, double v_A, double angle_deg,
                    double phase_shift_deg) {
  ASSERT_TRUE(defocus);
  EXPECT_NEAR(defocus->u_A, u_A, 1e-6);
  EXPECT_NEAR(defocus->v_A, v_A, 1e-6);
  EXPECT_NEAR(defocus->angle_deg, angle_deg, 1e-6);
  EXPECT_NEAR(defocus->phase_shift_deg, phase_shift_deg, 1e-3);
}

CtfTable read(const std::string& name, const std::string& text) {
  const ScratchDirectory scratch;
  return read_ctf(scratch.write(name, text));
}

std::string refusal(const std::string& name, const std::string& text) {
  return message_of<Error>([&] { read(name, text); });
}

const std::string kCtffindHead =
    "# Output from CTFFind version 4.1.8, run on 2019-02-25 11:33:34\n"
    "# Input file: a.mrc ; Number of micrographs: 3\n"
    "# Pixel size: 1.327 Angstroms ; acceleration voltage: 300.0 keV ; spherical aberration: 2.70 "
    "mm "
    "; amplitude contrast: 0.07\n"
    "# Box size: 512 pixels ; min. res.: 30.0 Angstroms ; max. res.: 5.0 Angstroms ; min. def.: "
    "10000.0 um; max. def. 75000.0 um\n"
    "# Columns: #1 - micrograph number; #2 - defocus 1 [Angstroms]; #3 - defocus 2; #4 - azimuth "
    "of "
    "astigmatism; #5 - additional phase shift [radians]; #6 - cross correlation; #7 - spacing (in "
    "Angstroms) up to which CTF rings were fit successfully";

TEST(CtfTable, ReadsCtffind4) {
  const CtfTable table =
      read("a.txt", kCtffindHead +
                        "\n1.000000 14477.87 13500.0 75.0 1.570796 0.001071 12.1\n"
                        "3.000000 19371.79 18665.48 -39.98 0.000000 0.006903 inf\n");
  EXPECT_EQ(table.optics.voltage_kV, 300.0);
  EXPECT_EQ(table.optics.spherical_aberration_mm, 2.7);
  EXPECT_EQ(table.optics.amplitude_contrast, 0.07);
  ASSERT_EQ(table.views.size(), 3u);
  expect_defocus(table.views[0], 14477.87, 13500.0, 75.0, 90.0);
  EXPECT_FALSE(table.views[1]);
  expect_defocus(table.views[2], 19371.79, 18665.48, -39.98, 0.0);
}

TEST(CtfTable, ReadsTheColumnsOfCtffind5) {
  const CtfTable table = read(
      "a.txt", kCtffindHead +
                   "; #8 - Estimated tilt axis angle; #9 - Estimated tilt angle ; #10 Estimated "
                   "sample thickness (in Angstroms)\n1.000000 8984.742188 8709.236328 45.948771 "
                   "0.000000 0.446317 3.720000 221.912292 12.251187 1619.773438\n");
  ASSERT_EQ(table.views.size(), 1u);
  expect_defocus(table.views[0], 8984.742188, 8709.236328, 45.948771, 0.0);
}

TEST(CtfTable, ReadsAreTomo) {
  const CtfTable table = read(
      "TS_CTF.txt",
      "# Columns: #1 micrograph number; #2 - defocus 1 [A]; #3 - defocus 2; #4 - azimuth of "
      "astigmatism; #5 - additional phase shift [radian]; #6 - cross correlation; #7 - spacing "
      "(in Angstroms) up to which CTF rings were fit successfully; #8 - dfHand\n"
      "   1   50016.20  48830.05     57.55     0.0000    0.0312   12.4000   -1\n"
      "   2   49016.20  47830.05     52.55     0.5236    0.0412   11.4000   -1\n");
  ASSERT_EQ(table.views.size(), 2u);
  EXPECT_FALSE(table.optics.voltage_kV);
  expect_defocus(table.views[0], 50016.20, 48830.05, 57.55, 0.0);
  expect_defocus(table.views[1], 49016.20, 47830.05, 52.55, 30.0);
}

TEST(CtfTable, RefusesRowsOfCtffindWithTheirLine) {
  expect_parts(refusal("a.txt", kCtffindHead + "\n1 nan 13500 75 0 0 12\n"), {"a.txt", "line 6"});
  expect_parts(refusal("a.txt", kCtffindHead + "\n1 14000 13500 75\n"), {"line 6", "azimuth"});
  expect_parts(refusal("a.txt", kCtffindHead + "\n0 14000 13500 75 0 0 9\n"), {"line 6"});
  expect_parts(
      refusal("a.txt", kCtffindHead + "\n1 14000 13500 75 0 0 9\n1 14000 13500 75 0 0 9\n"),
      {"line 7", "micrograph 1 comes twice"});
  expect_parts(refusal("a.txt", kCtffindHead), {"no defocus of any view"});
}

TEST(CtfTable, ReadsVersion2OfImod) {
  // The lines are about views 2, 5 and 7.
  const CtfTable table = read("TS.defocus",
                              "1\t3\t-60.0\t-56.0\t4000.0\t2\n4\t6\t-54.0\t-50.0\t4600.0\n"
                              "7\t8\t-48.0\t-46.0\t4200\n");
  ASSERT_EQ(table.views.size(), 8u);
  const double expected_A[] = {40000, 40000, 42000, 44000, 46000, 44000, 42000, 42000};
  for (std::size_t i = 0; i < 8; ++i)
    expect_defocus(table.views[i], expected_A[i], expected_A[i], 0.0, 0.0);
  EXPECT_EQ(table.tilt_deg[1], -58.0);  // a line's angles are those of its first and last view
  EXPECT_EQ(table.tilt_deg[0], std::nullopt);
  EXPECT_EQ(table.tilt_deg[6], -47.0);
  expect_parts(message_of<Error>([] { read("TS.defocus", "1 3 -60 500 4000 2\n"); }),
               {"TS.defocus", "line 1", "500"});
}

TEST(CtfTable, ReadsVersion3OfImod) {
  const CtfTable astigmatic = read("TS.defocus",
                                   "1 0 0. 0. 0 3\n1 1 -3.01 -3.01 4100.0 3900.0 25.5\n"
                                   "2 2 0.0 0.0 4000.0 0 0\n");
  ASSERT_EQ(astigmatic.views.size(), 2u);
  expect_defocus(astigmatic.views[0], 41000, 39000, 25.5, 0);
  expect_defocus(astigmatic.views[1], 40000, 40000, 0, 0);

  const CtfTable in_radians = read("TS.defocus",
                                   "47 0 0. 0. 0 3\n1 1 -3 -3 4100 3900 0.5235987756 "
                                   "1.5707963268 0.01\n");
  expect_defocus(in_radians.views.at(0), 41000, 39000, 30, 90);
  ASSERT_EQ(in_radians.not_applied.size(), 1u);
  expect_parts(in_radians.not_applied[0], {"cut-on"});

  const CtfTable phases = read("TS.defocus", "4 0 0. 0. 0 3\n1 1 -3 -3 4100 80\n");
  expect_defocus(phases.views.at(0), 41000, 41000, 0, 80);
}

TEST(CtfTable, InterpolatesAstigmatismAsAFunctionOfDirection) {
  // The direction passes 90, which is -90: halfway it is at 90, not at 0.
  const CtfTable table =
      read("TS.defocus", "1 0 0. 0. 0 3\n1 1 0 0 4100 3900 80\n3 3 4 4 4100 3900 -80\n");
  ASSERT_EQ(table.views.size(), 3u);
  const double half_A = 1000 * std::cos(20 * std::numbers::pi / 180);
  expect_defocus(table.views[1], 40000 + half_A, 40000 - half_A, 90, 0);
}

TEST(CtfTable, RefusesWhatIsNoDefocusFile) {
  expect_parts(refusal("a.defocus", "1 1 -60 -60 4000\n"),
               {"a.defocus", "line 1", "version 2 or 3"});
  expect_parts(refusal("a.defocus", "1 0 0 0 0 4\n1 1 0 0 4000\n"), {"version 2 or 3"});
  expect_parts(refusal("a.defocus", "1 0 0 0 0 3\n1 1 0 0 4000\n"), {"line 2", "second defocus"});
  expect_parts(refusal("a.defocus", "3 1 0 0 4000 2\n"), {"line 1", "first and last view"});
  expect_parts(refusal("a.defocus", ""), {"a.defocus", "empty"});
  expect_parts(refusal("TS_CTF_Imod.txt", "1 0 0 0 0 3\n1 1 0 0 3900 4100 20\n"), {"NAME_CTF.txt"});
}

TEST(CtfTable, ReadsRelion) {
  const CtfTable table =
      read("TS.star",
           "data_optics\nloop_\n_rlnVoltage #1\n_rlnSphericalAberration #2\n"
           "_rlnAmplitudeContrast #3\n300 2.7 0.1\ndata_TS_01\nloop_\n_rlnMicrographName #1\n"
           "_rlnDefocusU #2\n_rlnDefocusV #3\n_rlnDefocusAngle #4\n_rlnPhaseShift #5\n"
           "a.mrc 40000 39000 -45 90\nb.mrc None 39000 -45 90\n");
  ASSERT_EQ(table.views.size(), 2u);
  expect_defocus(table.views[0], 40000, 39000, -45, 90);
  EXPECT_FALSE(table.views[1]);
  EXPECT_EQ(table.optics.amplitude_contrast, 0.1);
  expect_parts(refusal("TS.star", "data_t\nloop_\n_rlnMicrographName #1\na.mrc\n"),
               {"rlnDefocusU"});
}

TEST(CtfTable, ReadsGctf) {
  const CtfTable table =
      read("series_gctf.star",
           "\ndata_\n\nloop_\n_rlnMicrographName #1\n_rlnCtfImage #2\n_rlnDefocusU #3\n"
           "_rlnDefocusV #4\n_rlnDefocusAngle #5\n_rlnVoltage #6\n_rlnSphericalAberration #7\n"
           "_rlnAmplitudeContrast #8\n_rlnMagnification #9\n_rlnDetectorPixelSize #10\n"
           "_rlnCtfFigureOfMerit #11\n_rlnFinalResolution #12\n"
           "part.mrc.01 part.mrc.01.ctf:mrc 41234.562500 40987.125000    21.500000   200.000000"
           "     1.400000     0.080000 50000.000000    14.000000     0.040000     6.500000\n"
           "part.mrc.02 part.mrc.02.ctf:mrc 42000.000000 43000.500000    88.250000   200.000000"
           "     1.400000     0.080000 50000.000000    14.000000     0.050000     7.500000\n\n");
  ASSERT_EQ(table.views.size(), 2u);
  expect_defocus(table.views[0], 41234.5625, 40987.125, 21.5, 0);
  expect_defocus(table.views[1], 42000, 43000.5, 88.25, 0);
  EXPECT_EQ(table.optics.voltage_kV, 200.0);
  EXPECT_EQ(table.optics.spherical_aberration_mm, 1.4);
  EXPECT_EQ(table.optics.amplitude_contrast, 0.08);
  ASSERT_TRUE(table.optics.pixel_size_A.has_value());
  EXPECT_NEAR(*table.optics.pixel_size_A, 2.8, 1e-9);  // 14 µm at 50,000 times
  const std::string views =
      "\ndata_a\n\nloop_\n_rlnDefocusU #1\n_rlnDefocusV #2\n"
      "_rlnDefocusAngle #3\n_rlnVoltage #4\n3e4 3e4 0 300\n";
  expect_parts(message_of<Error>([&] {
                 read("a.star", "\ndata_optics\n\nloop_\n_rlnVoltage #1\n200\n" + views);
               }),
               {"a.star", "_rlnVoltage", "row 1"});
}

const std::string kWarp =
    "<TiltSeries AreAnglesInverted=\"True\"><Angles>-60\n-57</Angles><MoviePath>a.tif\nb.tif"
    "</MoviePath><CTF><Param Name=\"Voltage\" Value=\"300\"/><Param Name=\"Cs\" Value=\"2.7\"/>"
    "<Param Name=\"Amplitude\" Value=\"0.07\"/><Param Name=\"Defocus\" Value=\"1\"/></CTF>";

std::string grid(const std::string& name, const std::vector<std::string>& values) {
  std::string text = "<" + name + " Width=\"1\" Height=\"1\">";
  for (std::size_t i = 0; i < values.size(); ++i)
    text += "<Node X=\"0\" Y=\"0\" Z=\"" + std::to_string(i) + "\" Value=\"" + values[i] + "\"/>";
  return text + "</" + name + ">";
}

TEST(CtfTable, ReadsWarp) {
  const CtfTable table = read("TS.xml", kWarp + grid("GridCTF", {"4.0", "4.2"}) +
                                            grid("GridCTFDefocusDelta", {"0.2"}) +
                                            grid("GridCTFDefocusAngle", {"30", "-20"}) +
                                            grid("GridCTFPhase", {"0.5", "0"}) + "</TiltSeries>");
  ASSERT_EQ(table.views.size(), 2u);
  expect_defocus(table.views[0], 41000, 39000, 30, 90);
  expect_defocus(table.views[1], 43000, 41000, -20, 0);
  EXPECT_EQ(table.optics.voltage_kV, 300.0);
  EXPECT_EQ(table.optics.spherical_aberration_mm, 2.7);
  EXPECT_EQ(table.optics.amplitude_contrast, 0.07);
  expect_parts(refusal("TS.xml", kWarp + grid("GridCTF", {"0"}) + "</TiltSeries>"),
               {"TS.xml", "no defocus"});
}

TEST(CtfTable, IsReadAsItWasWritten) {
  const ScratchDirectory scratch;
  const std::vector<WrittenCtf> sections{{-60, {41000, 39000, 30.5, 45}},
                                         {-57.5, {42000, 42000, 0, 0}}};
  write_ctffind(scratch / "a.txt", sections, {300, 2.7, 0.07}, 5.0);
  write_imod_defocus(scratch / "a.defocus", sections);
  for (const char* name : {"a.txt", "a.defocus"}) {
    const CtfTable table = read_ctf(scratch / name);
    ASSERT_EQ(table.views.size(), 2u) << name;
    expect_defocus(table.views[0], 41000, 39000, 30.5, 45);
    expect_defocus(table.views[1], 42000, 42000, 0, 0);
  }
  EXPECT_EQ(read_ctf(scratch / "a.txt").optics.voltage_kV, 300.0);
}

TEST(CtfTable, UnitsAndLimitsOfTheMicroscopeAreRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& comment) {
    const auto path = scratch.write("a_ctf.txt", "# " + comment +
                                                     "\n# Columns: #2 - defocus 1 [Angstroms]\n"
                                                     "1 30000 30000 0 0 0.5 5\n");
    return message_of<Error>([&] { read_ctf(path); });
  };
  EXPECT_EQ(refusal("acceleration voltage: 300.0 keV ; spherical aberration: 2.70 mm ; "
                    "amplitude contrast: 0.07"),
            "");
  expect_parts(refusal("acceleration voltage: 300000 V"), {"line 1", "'V'", "keV"});
  expect_parts(refusal("spherical aberration: 2700 um"), {"line 1", "'um'", "mm"});
  expect_parts(refusal("acceleration voltage: 300000 keV"), {"voltage", "300000"});
  expect_parts(refusal("spherical aberration: -2.7 mm"), {"aberration", "-2.7"});
  expect_parts(refusal("acceleration voltage: 300 keV\n# acceleration voltage: 200 keV"),
               {"line 2", "acceleration voltage", "200", "300"});
  expect_parts(refusal("amplitude contrast: 7"), {"amplitude contrast", "7"});
  expect_parts(refusal("Columns: #2 - defocus 1 [nm]"), {"line 1", "defocus 1", "[nm]"});
  for (const char* column :
       {"#5 - additional phase shift [degrees]", "#5 - additional phase shift (degrees)",
        "#2 - defocus 1 (nm); #3 - defocus 2", "#2 - defocus 1 in um", "#3 - defocus 2 [nm]",
        "#4 - azimuth of astigmatism [radians]; #5 - additional phase shift [radians]"})
    expect_parts(refusal(column), {"line 1", "the column", "correct it"});
  for (const char* column : {"#2 - defocus 1 [Å]; #3 - defocus 2 (in Angstroms)",
                             "#4 - azimuth of astigmatism; #5 - additional phase shift [radian]"})
    EXPECT_EQ(refusal(column), "");
  EXPECT_EQ(refusal("Number of micrographs: 4"), "");
  expect_parts(refusal("Number of micrographs: 0"), {"0 micrographs", "number 1"});
}

TEST(CtfTable, DirectionsAndPhasesOfImodBeyondATurnAreRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& flags, const std::string& columns) {
    return message_of<Error>([&] {
      read_ctf(scratch.write("a.defocus", flags + " 0 0. 0. 0 3\n1 1 0 0 3000 " + columns + "\n"));
    });
  };
  EXPECT_EQ(refusal("5", "2900 350 90"), "");
  EXPECT_EQ(refusal("15", "2900 3 1.5"), "");
  for (const auto& [flags, columns] :
       {std::pair("1", "2900 9999"), {"5", "2900 20 9999"}, {"13", "2900 20 90"}})
    expect_parts(refusal(flags, columns), {"line 2", "cannot be", "flags"});
}

TEST(CtfTable, ADefocusOfImodThatComesTwiceIsRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& lines) {
    return message_of<Error>([&] { read_ctf(scratch.write("a.defocus", lines)); });
  };
  EXPECT_EQ(refusal("1 3 0 0 3000 2\n2 4 0 0 3100\n"), "");
  expect_parts(refusal("1 1 0 0 3000 2\n2 2 0 0 3100\n2 2 0 0 3200\n"),
               {"line 3", "view 2", "twice"});
  expect_parts(refusal("1 3 0 0 3000 2\n2 2 0 0 3100\n"), {"line 2", "view 2", "twice"});
  expect_parts(refusal("1.5 1.7 0 0 3000 2\n"), {"line 1", "1.5"});
}

}  // namespace
}  // namespace tomofield::io
