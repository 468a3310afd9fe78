#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "expect_parts.h"
#include "imod_folder.h"
#include "io/images/image_stack.h"

namespace tomofield::projects {
namespace {

using testing::expect_parts;
using testing::ImodFolder;

TEST(ImodTransfer, OpticsOfTheCommandsAreReadOrRefused) {
  const ImodFolder imod;
  imod.write_tilt("THICKNESS 900\n");
  const auto write = [&](const std::string& entries) {
    imod.folder.write("ctfcorrection.com", "$ctfphaseflip -StandardInput\n" + entries);
  };
  write("Voltage 300\nVoltage 300\n");
  EXPECT_EQ(imod.values().at("--voltage"), "300");
  write("Voltage 300\n$ctfphaseflip -StandardInput\nVoltage 200\n");
  expect_parts(imod.refusal(), {"ctfcorrection.com", "line 4", "Voltage is 200", "300"});
  write("Voltage 300\n");
  imod.folder.write("ctfplotter.com", "$ctfplotter -StandardInput\nVoltage 200\n");
  expect_parts(imod.refusal(), {"ctfplotter.com", "line 2", "Voltage is 200", "ctfcorrection.com"});
  imod.folder.write("ctfplotter.com", "$ctfplotter -StandardInput\nVoltage 300\n");
  EXPECT_EQ(imod.refusal(), "");
  write("SphericalAberration 0.0\nAmplitudeContrast 0\n");  // a corrected microscope has none
  EXPECT_EQ(imod.refusal(), "");
  for (const char* bad : {"abc", "0", "-3"}) {
    write(std::string("Voltage ") + bad + "\n");
    expect_parts(imod.refusal(), {"ctfcorrection.com", "line 2", "Voltage"});
    EXPECT_FALSE(imod.values({"Voltage"}).contains("--voltage"));
  }
}

TEST(ImodTransfer, TheDefocusFileOfTheCommandsComesFirst) {
  const ImodFolder imod;
  imod.write_tilt("THICKNESS 900\n");
  const std::string defocus = "1 1 0 0 3000 2\n";
  imod.folder.write("other.defocus", defocus);
  imod.folder.write("ctfcorrection.com",
                    "$ctfphaseflip -StandardInput\nDefocusFile other.defocus\n"
                    "PhaseShiftInDegrees 90\nInvertTiltAngles 0\n");
  EXPECT_EQ(imod.values().at("--ctf"), (imod.folder / "other.defocus").string());
  expect_parts(imod.warnings(), {"ctfcorrection.com", "line 3", "PhaseShiftInDegrees"});
  EXPECT_EQ(imod.warnings({"PhaseShiftInDegrees"}), "");
  std::filesystem::rename(imod.folder / "other.defocus", imod.folder / "TS.defocus");
  EXPECT_EQ(imod.values().at("--ctf"), (imod.folder / "TS.defocus").string());
}

TEST(ImodTransfer, EntriesOfTheCorrectionThatAreNotAppliedAreNamed) {
  const ImodFolder imod;
  imod.folder.write("TS.defocus", "1 1 0 0 3000 2\n");
  const auto warnings = [&](const std::string& tilt, const std::string& entry) {
    imod.write_tilt("THICKNESS 900\n" + tilt);
    imod.folder.write(
        "ctfcorrection.com",
        "$ctfphaseflip -StandardInput\nDefocusFile TS.defocus\nDefocusTol 200\n" + entry + "\n");
    return imod.warnings();
  };
  for (const char* entry : {"OffsetInZ 400", "XAxisTilt 30", "PhasePlateShift 1"})
    expect_parts(warnings("", entry), {"ctfcorrection.com", "line 4", "is not applied"});
  for (const auto& [tilt, entry] :
       {std::pair("XAXISTILT 2.5\n", "XAxisTilt 2.5"), {"", "OffsetInZ 0"}, {"", "UseGPU 0"}})
    EXPECT_EQ(warnings(tilt, entry).find("not applied"), std::string::npos) << entry;
}

// The size is in nm: ctfphaseflip's is that of binned pixels of the aligned stack.
TEST(ImodTransfer, ThePixelSizeOfTheCommandsIsTakenOrCompared) {
  const ImodFolder imod;
  imod.write_newst("BinByFactor 2\n");
  imod.write_tilt("THICKNESS 900\nIMAGEBINNED 2\n");
  const double in_header_nm =
      io::open_image_stack(imod.folder / "TS.st")->header().voxel_size_A[0] / 10;
  ASSERT_GT(in_header_nm, 0.1);
  const auto write = [&](const char* command, const std::string& entries) {
    imod.folder.write(std::string("ctf") + command + ".com", "$ctf\n" + entries);
  };
  const auto size = [](double nm) { return fmt::format("PixelSize {}\n", nm); };
  write("correction", size(2 * in_header_nm));
  EXPECT_EQ(imod.warnings().find("states pixels of"), std::string::npos) << imod.warnings();
  write("correction", size(4 * in_header_nm));
  expect_parts(imod.warnings(), {"ctfcorrection.com", "states pixels of", "PixelSize"});
  EXPECT_EQ(imod.warnings({"PixelSize"}).find("states pixels of"), std::string::npos);
  EXPECT_FALSE(imod.values().contains("--pixel-size"));

  // ctfplotter states the size of the raw stack's pixels, as UnbinnedPixelSize does.
  write("plotter", size(in_header_nm));
  for (const std::string& of_aligned :
       {size(in_header_nm), size(2 * in_header_nm),
        size(2 * in_header_nm) + fmt::format("UnbinnedPixelSize {}\n", in_header_nm)}) {
    write("correction", of_aligned);
    EXPECT_EQ(imod.refusal(), "") << of_aligned;
    EXPECT_EQ(imod.warnings().find("states pixels of"), std::string::npos) << imod.warnings();
  }
  write("correction", size(3 * in_header_nm));  // of an earlier binning
  EXPECT_EQ(imod.refusal(), "");
  expect_parts(imod.warnings(),
               {"ctfcorrection.com", "line 2", "PixelSize", "is not used", "ctfplotter.com"});
  EXPECT_EQ(imod.warnings({"PixelSize"}).find("is not used"), std::string::npos);
  write("plotter", size(in_header_nm) + size(2 * in_header_nm));
  expect_parts(imod.refusal(), {"ctfplotter.com", "line 3", "PixelSize"});
  write("plotter", size(in_header_nm));
  write("correction", "");
  write("plotter", size(2 * in_header_nm));
  expect_parts(imod.warnings(), {"ctfplotter.com", "states pixels of 5 Å"});
}

TEST(ImodTransfer, TheAxisOfCtfplotterIsComparedWithThatOfTheTransforms) {
  const ImodFolder imod;
  imod.write_newst("");
  imod.write_tilt("THICKNESS 900\n");
  const auto write = [&](const char* axis) {
    imod.folder.write("ctfplotter.com",
                      std::string("$ctfplotter -StandardInput\nAxisAngle ") + axis);
  };
  write("-97");
  EXPECT_EQ(imod.warnings().find("AxisAngle"), std::string::npos) << imod.warnings();
  write("85.3");
  expect_parts(imod.warnings(), {"TS.xf", "-99.8°", "AxisAngle", "ctfplotter.com", "85.3°"});
  EXPECT_EQ(imod.warnings({"AxisAngle"}).find("85.3"), std::string::npos);
  write("steep");
  expect_parts(imod.refusal(), {"ctfplotter.com", "line 2", "AxisAngle steep"});
}

}  // namespace
}  // namespace tomofield::projects
