#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "expect_parts.h"
#include "imod_folder.h"
#include "pixel_stack.h"
#include "projects/project.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::projects {
namespace {

using testing::expect_parts;
using testing::ImodFolder;
using testing::message_of;
using testing::ScratchDirectory;
using testing::some_value;
using testing::Values;
using testing::write_stack;

TEST(ImodProject, RawStackWithItsTransforms) {
  const ImodFolder imod;
  imod.write_newst("BinByFactor\t4\nSizeToOutputInXandY\t15,10\nOffsetsInXandY\t0.0,0.0\n");
  imod.write_tilt(
      "IMAGEBINNED 4\nTHICKNESS 900\nXAXISTILT 1.5\nXTILTFILE TS.xtilt\n"
      "FULLIMAGE 60 40\nSUBSETSTART 0 0\nOFFSET -2.5\nSHIFT 0.0 12.0\nLOG 0.0\n"
      "EXCLUDELIST2 1, 3\nEXCLUDELIST2 5\n");
  const auto in = [&](const char* name) { return (imod.folder / name).string(); };
  EXPECT_EQ(imod.values(), (Values{{"stack", in("TS.st")},
                                   {"--xf", in("TS.xf")},
                                   {"--tlt", in("TS.tlt")},
                                   {"--xtilt", in("TS.xtilt")},
                                   {"--bin", "4"},
                                   {"--thickness", "900"},
                                   {"--x-axis-tilt", "1.5"},
                                   {"--tilt-offset", "-2.5"},
                                   {"--shift-z", "-12"},
                                   {"--exclude", "1,3,5"},
                                   {"--log", "true"}}));
  EXPECT_EQ(imod.warnings(), "");
  const Project project = imod.read();
  const auto& thickness = *std::ranges::find(project.settings(), "--thickness", &Setting::option);
  EXPECT_EQ(thickness.file, imod.folder / "tilt.com");
  EXPECT_EQ(thickness.entry, "THICKNESS");
}

TEST(ImodProject, EntriesAreReadInAnyCaseAndLeftOutIfIgnored) {
  const ImodFolder imod;
  imod.write_tilt("thickness 20\nMode 2\nLOG 5\n");
  EXPECT_EQ(imod.values().at("--thickness"), "20");
  EXPECT_EQ(imod.values().at("--log-base"), "5");
  const Values without = imod.values({"Thickness", "log"});
  EXPECT_FALSE(without.contains("--thickness") || without.contains("--log") ||
               without.contains("--log-base"));
  expect_parts(imod.refusal({"THICKNES"}), {"--ignore THICKNES", "tilt.com"});
}

TEST(ImodProject, AlignedStackInItsOwnPixels) {
  const ImodFolder imod;
  std::filesystem::remove(imod.folder / "TS.st");
  write_stack(imod.folder / "TS_ali.mrc", 15, 10, 5, some_value);
  imod.write_newst("BinByFactor 4\nSizeToOutputInXandY 15,10\n");
  imod.write_tilt("IMAGEBINNED 4\nTHICKNESS 900\nSHIFT 0 12\nWIDTH 40\nSLICE 8 31\n");
  const Values values = imod.values();
  EXPECT_EQ(values.at("stack"), (imod.folder / "TS_ali.mrc").string());
  EXPECT_FALSE(values.contains("--xf") || values.contains("--bin"));
  EXPECT_EQ(values.at("--thickness"), "225");
  EXPECT_EQ(values.at("--shift-z"), "-3");
  EXPECT_EQ(values.at("--roi"), "3,2,13,8");  // (60 − 40) / 2 / 4 = 2.5, rounded
}

TEST(ImodProject, IgnoringTheTransformsTakesTheAlignedStack) {
  const ImodFolder imod;
  imod.write_tilt("THICKNESS 20\n");
  expect_parts(imod.refusal({"TransformFile"}), {"TS_ali.mrc"});
  write_stack(imod.folder / "TS_ali.mrc", 15, 10, 5, some_value);
  imod.write_newst("");
  EXPECT_EQ(imod.values().at("stack"), (imod.folder / "TS.st").string());
  EXPECT_EQ(imod.values({"TransformFile"}).at("stack"), (imod.folder / "TS_ali.mrc").string());
}

TEST(ImodProject, AStackWithOtherSectionsThanTheRawOneIsRead) {
  const ImodFolder imod;
  imod.write_tilt("");
  write_stack(imod.folder / "TS_ali.mrc", 40, 60, 5, some_value);
  for (const std::string entry : {"ReorderByTiltAngle", "BlankOutput", "ReverseInputFileOrder"}) {
    imod.write_newst(entry + " 1\n");
    EXPECT_EQ(imod.values().at("stack"), (imod.folder / "TS_ali.mrc").string()) << entry;
    expect_parts(imod.warnings(), {entry, "aligned stack is read"});
  }
}

TEST(ImodProject, RawFilesAreFoundByTheirUsualNames) {
  const ImodFolder imod;
  imod.write_tilt("IMAGEBINNED 2\n");
  EXPECT_EQ(imod.values().at("--xf"), (imod.folder / "TS.xf").string());
  EXPECT_EQ(imod.values().at("--bin"), "2");
  imod.folder.write("blend.com", "$blendmont -StandardInput\n");  // the raw stack is a montage
  expect_parts(imod.refusal(), {"tilt.com", "TS_ali.mrc"});
  std::filesystem::remove(imod.folder / "blend.com");
  std::filesystem::remove(imod.folder / "TS.xf");
  expect_parts(imod.refusal(), {"tilt.com", "TS_ali.mrc"});
}

TEST(ImodProject, SizesAndOffsetsBecomeARegion) {
  const ImodFolder imod;
  const auto roi = [&](const std::string& newst, const std::string& tilt) {
    imod.write_newst("BinByFactor 2\n" + newst);
    imod.write_tilt("IMAGEBINNED 2\n" + tilt);
    const Values values = imod.values();
    const auto found = values.find("--roi");
    return found == values.end() ? "none" : found->second;
  };
  EXPECT_EQ(roi("SizeToOutputInXandY 30,20\n", ""), "none");
  EXPECT_EQ(roi("SizeToOutputInXandY 31,20\n", ""), "none");  // one pixel beyond, by rounding
  EXPECT_EQ(roi("SizeToOutputInXandY 20,10\n", ""), "10,10,50,30");
  EXPECT_EQ(roi("SizeToOutputInXandY 20,10\nOffsetsInXandY 6,-4\n", ""), "16,6,56,26");
  const std::string whole = "SizeToOutputInXandY 30,20\n";
  EXPECT_EQ(roi(whole, "WIDTH 40\n"), "10,0,50,40");
  EXPECT_EQ(roi(whole, "WIDTH 40\nSHIFT 8 0\n"), "2,0,42,40");  // the volume shows what lies left
  EXPECT_EQ(roi(whole, "SLICE 4 19\n"), "0,4,60,20");
  EXPECT_EQ(roi("SizeToOutputInXandY 20,10\n", "WIDTH 20\nSLICE 2 5\n"), "20,12,40,16");
  // Without a size the aligned stack has that of the raw one, whose sides are exchanged.
  for (const char* size :
       {"", "SizeToOutputInXandY ,,\n", "SizeToOutputInXandY 20,/\n", "SizeToOutputInXandY /\n"})
    EXPECT_EQ(roi(size, ""), "10,0,50,40") << size;
  expect_parts(imod.warnings(), {"the size of the raw stack", "beyond"});
  imod.write_newst("BinByFactor 2\n" + whole);
  imod.write_tilt("IMAGEBINNED 2\nSHIFT 90 0\n");
  expect_parts(imod.refusal(), {"tilt.com", "SHIFT", "no part"});
  imod.write_tilt("IMAGEBINNED 2\nSHIFT 20 0\n");
  expect_parts(imod.warnings(), {"SHIFT", "beyond"});
}

TEST(ImodProject, TheTiltAxisIsWhereTheSubsetHasIt) {
  const ImodFolder imod;
  const auto center = [&](const std::string& newst, const std::string& tilt) {
    imod.write_newst("BinByFactor 2\n" + newst);
    imod.write_tilt("IMAGEBINNED 2\n" + tilt);
    const Values values = imod.values();
    const auto found = values.find("--center");
    return found == values.end() ? "none" : found->second;
  };
  const std::string whole = "SizeToOutputInXandY 30,20\n";
  EXPECT_EQ(center(whole, "FULLIMAGE 60 40\nSUBSETSTART 0 0\n"), "none");
  EXPECT_EQ(center("", "FULLIMAGE 40 60\nSUBSETSTART 0 0\n"), "none");
  EXPECT_EQ(center("", "FULLIMAGE\nSUBSETSTART /\n"), "none");
  // An aligned stack that is larger or smaller than the images, about the same centre.
  EXPECT_EQ(center("SizeToOutputInXandY 31,20\n", "FULLIMAGE 60 40\nSUBSETSTART -1 0\n"), "none");
  EXPECT_EQ(center("SizeToOutputInXandY 20,20\n", "FULLIMAGE 60 40\nSUBSETSTART 10 0\n"), "none");
  // The part of the images that is aligned lies 6 pixels to the right: the axis stays in the middle
  // of the views.
  EXPECT_EQ(center("SizeToOutputInXandY 20,20\nOffsetsInXandY 6,0\n",
                   "FULLIMAGE 60 40\nSUBSETSTART 16 0\n"),
            "none");
  // The entries of tilt.com put the axis elsewhere.
  EXPECT_EQ(center("SizeToOutputInXandY 20,20\n", "FULLIMAGE 60 40\nSUBSETSTART 4 0\n"), "36");
  EXPECT_EQ(center("SizeToOutputInXandY 20,20\n", "FULLIMAGE 60 40\n"), "40");  // from 0 on
  EXPECT_EQ(center(whole, "OFFSET 0 -7\n"), "23");
  EXPECT_EQ(center(whole, "OFFSET ,-7\n"), "23");
  imod.write_tilt("IMAGEBINNED 2\nFULLIMAGE 60 40\nSUBSETSTART 0 6\nXAXISTILT 2\n");
  expect_parts(imod.warnings(), {"SUBSETSTART", "-6 unbinned"});
  for (const std::string bad : {"0 0", "-32 32", "60 0"}) {
    imod.write_tilt("IMAGEBINNED 2\nFULLIMAGE " + bad + "\n");
    expect_parts(imod.refusal(), {"tilt.com', line 7", "FULLIMAGE " + bad, "--ignore FULLIMAGE"});
    EXPECT_EQ(imod.refusal({"FULLIMAGE"}), "");
  }
  imod.write_tilt("IMAGEBINNED 2\nSUBSETSTART 4 0\n");
  expect_parts(imod.refusal(), {"SUBSETSTART", "FULLIMAGE"});
}

TEST(ImodProject, WhatCannotBeHonouredIsRefusedOrSaid) {
  const ImodFolder imod;
  for (const std::string entry : {"LOCALFILE", "ZFACTORFILE", "ANGLES", "COMPRESS", "REPLICATE",
                                  "TOTALSLICES", "BaseRecFile"}) {
    imod.write_tilt(entry + " 1 2\n");
    expect_parts(imod.refusal(), {"tilt.com', line 6", entry, "--ignore " + entry});
    EXPECT_EQ(imod.refusal({entry}), "");
  }
  imod.write_tilt("RADIAL 0.35 0.035\nSCALE 0 330\nPERPENDICULAR\nMODE 1\n");
  EXPECT_EQ(imod.warnings(), "");
  imod.write_tilt("WOBBLE 3\nPARALLEL\nWeightFile w.txt\n");
  expect_parts(imod.warnings(), {"line 6", "WOBBLE", "PARALLEL", "WeightFile"});
  EXPECT_EQ(imod.warnings({"WOBBLE", "PARALLEL", "WeightFile"}), "");
  imod.write_newst("FloatDensities 2\n");
  expect_parts(imod.warnings({"WOBBLE"}), {"newst.com", "FloatDensities"});
  for (const std::string bad :
       {"THICKNESS thick\n", "THICKNESS nan\n", "THICKNESS 1 2\n", "THICKNESS 1e30\n",
        "SHIFT 1 2 3\n", "EXCLUDELIST2 0\n", "EXCLUDELIST2 2,6\n", "IMAGEBINNED 0\n",
        "THICKNESS 2\nTHICKNESS 2\n", "INCLUDE 1\nEXCLUDELIST 2\n"}) {
    imod.write_tilt(bad);
    EXPECT_NE(imod.refusal(), "") << bad;
  }
}

TEST(ImodProject, AreTomosLocalFileIsThatOfTheWholeViews) {
  const ImodFolder imod;
  imod.write_newst("");
  imod.write_tilt("LOCALFILE TS.xf\n");
  expect_parts(imod.warnings(), {"LOCALFILE", "AreTomo"});
}

TEST(ImodProject, PlacesOfLocalAlignmentsCountInWholeViews) {
  const ImodFolder imod;
  imod.folder.write("TSlocal.xf", "1 1 10 10 20 20\n");
  std::filesystem::remove(imod.folder / "TS.st");
  write_stack(imod.folder / "TS_ali.mrc", 40, 60, 5, some_value);
  const std::string local = "LOCALFILE TSlocal.xf\nFULLIMAGE ";
  imod.write_tilt(local + "60 90\nSUBSETSTART 10 15\n");
  expect_parts(imod.refusal(), {"tilt.com", "FULLIMAGE", "10, 15 pixels", "--ignore LOCALFILE"});
  imod.write_tilt(local + "42 63\nSUBSETSTART 1 2\n");
  EXPECT_EQ(imod.refusal(), "");
  EXPECT_TRUE(imod.values().contains("--local"));
}

TEST(ImodProject, FilesThatAreNamedAndNotThereAreWarnedOf) {
  const ImodFolder imod;
  imod.write_tilt("");
  imod.folder.write("newst.com",
                    "$newstack -StandardInput\nInputFile TS.st\nTransformFile other.xf\n");
  expect_parts(imod.warnings(), {"newst.com", "TransformFile other.xf", "not there"});
  imod.write_newst("");
  imod.folder.write("ctfcorrection.com",
                    "$ctfphaseflip -StandardInput\nDefocusFile other.defocus\n");
  expect_parts(imod.warnings(), {"ctfcorrection.com", "DefocusFile other.defocus", "not there"});
}

TEST(ImodProject, ViewsToIncludeLeaveOutTheOthers) {
  const ImodFolder imod;
  imod.write_tilt("INCLUDE 2-3\nINCLUDE 5\n");
  EXPECT_EQ(imod.values().at("--exclude"), "1,4");
}

TEST(ImodProject, BinningsThatDiffer) {
  const ImodFolder imod;
  imod.write_newst("BinByFactor 4\n");
  imod.write_tilt("IMAGEBINNED 2\n");
  expect_parts(imod.refusal(), {"BinByFactor 4", "IMAGEBINNED 2"});
  EXPECT_EQ(imod.values({"BinByFactor"}).at("--bin"), "2");
  imod.write_tilt("");  // tilt counts lengths in pixels of its images then
  expect_parts(imod.refusal(), {"BinByFactor 4", "no IMAGEBINNED"});
  EXPECT_EQ(imod.values({"IMAGEBINNED"}).at("--bin"), "4");
}

TEST(ImodProject, AShrunkStackIsAsLargeAsABinnedOne) {
  const ImodFolder imod;
  imod.write_newst("ShrinkByFactor 2\n");
  imod.write_tilt("IMAGEBINNED 2\nTHICKNESS 80\n");
  write_stack(imod.folder / "TS_ali.mrc", 30, 20, 5, some_value);
  expect_parts(imod.warnings(), {"ShrinkByFactor", "aligned stack is read"});
  EXPECT_EQ(imod.values().at("--thickness"), "40");
  imod.write_tilt("IMAGEBINNED 4\n");
  expect_parts(imod.refusal(), {"ShrinkByFactor 2", "IMAGEBINNED 4", "--ignore ShrinkByFactor"});
}

TEST(ImodProject, ACopyHasTheFilesOfTheFirst) {
  const ImodFolder imod;
  imod.write_newst("BinByFactor 2\n");
  imod.write_tilt("IMAGEBINNED 2\n");
  for (const auto& [copy, newst] : {std::pair("tilt_thick.com", "newst.com"),
                                    {"tilt2.com", "newst.com"},
                                    {"tilt-thick.com", "newst.com"},
                                    {"tilta_thick.com", "newsta.com"}}) {
    std::filesystem::copy_file(imod.folder / "tilt.com", imod.folder / copy);
    if (!std::filesystem::exists(imod.folder / newst))
      std::filesystem::copy_file(imod.folder / "newst.com", imod.folder / newst);
    const Project project = read_project({.path = imod.folder / copy}).value();
    const auto& bin = *std::ranges::find(project.settings(), "--bin", &Setting::option);
    EXPECT_EQ(bin.file, imod.folder / newst);
  }
}

TEST(ImodProject, StacksOfOtherSeriesAreNamed) {
  const ImodFolder imod;
  imod.folder.write("newst.com",
                    "$newstack -StandardInput\nInputFile TS.st\nOutputFile TS_02_ali.mrc\n"
                    "TransformFile TS.xf\nSizeToOutputInXandY 60,40\n");
  imod.write_tilt("");
  expect_parts(imod.warnings(), {"TS_02_ali.mrc", "TS_ali.mrc"});
  EXPECT_EQ(imod.warnings({"OutputFile"}), "");
  for (const std::string name : {"TS_02", "T"}) {
    const auto edf = imod.folder.write(name + ".edf", "Setup.DatasetName=" + name + "\n");
    expect_parts(message_of<Error>([&] { read_project({.path = edf}); }),
                 {name + ".edf", "'" + name + "'", "TS.st"});
  }
}

TEST(ImodProject, DirectionsOfAstigmatismHoldForTheRawStack) {
  const ImodFolder imod;
  write_stack(imod.folder / "TS_ali.mrc", 15, 10, 5, some_value);
  imod.write_newst("SizeToOutputInXandY 60,40\n");
  imod.write_tilt("");
  imod.folder.write("TS.defocus", "1 0 0. 0. 0 3\n1 1 0 0 1500 1500 0\n");
  EXPECT_EQ(imod.warnings({"TransformFile"}), "");
  imod.folder.write("TS.defocus", "1 0 0. 0. 0 3\n1 1 0 0 1500 1400 30\n");
  expect_parts(imod.warnings({"TransformFile"}), {"astigmatism", "TS_ali.mrc"});
  EXPECT_EQ(imod.warnings(), "");
}

TEST(ImodProject, ImagesThatTransformsDoNotMakeAreReadAligned) {
  const ImodFolder imod;
  imod.write_newst("SectionsToRead 1-4\n");
  imod.write_tilt("");
  expect_parts(imod.refusal(), {"SectionsToRead", "TS_ali.mrc"});
  write_stack(imod.folder / "TS_ali.mrc", 60, 40, 4, some_value);
  EXPECT_EQ(imod.values().at("stack"), (imod.folder / "TS_ali.mrc").string());
  expect_parts(imod.warnings(), {"SectionsToRead", "aligned stack"});
  EXPECT_EQ(imod.values({"SectionsToRead"}).at("stack"), (imod.folder / "TS.st").string());
}

TEST(ImodProject, OtherCommandFiles) {
  const ImodFolder imod;
  const auto refuse = [&](const std::string& text) {
    imod.folder.write("tilt.com", text);
    return imod.refusal();
  };
  expect_parts(refuse("$newstack -StandardInput\nInputFile a\n"), {"tilt.com", "$tilt"});
  expect_parts(refuse("$tilt a.ali a.rec\nTHICKNESS 4\n"), {"line 1", "-StandardInput"});
  EXPECT_NE(refuse("$tilt -StandardInput\n$tilt -StandardInput\n"), "");
}

// Writes a stack of bytes that are all 0, as a file with a hole.
void write_empty_stack(const std::filesystem::path& path, std::int32_t nx, std::int32_t ny,
                       std::int32_t nz) {
  write_stack(path, 1, 1, 1, some_value);
  const std::int32_t start[] = {nx, ny, nz, 0};  // mode 0
  std::fstream(path, std::ios::binary | std::ios::in | std::ios::out)
      .write(reinterpret_cast<const char*>(start), sizeof(start));
  constexpr std::int64_t kHeaderBytes = 1024;
  const std::int64_t pixels = std::int64_t{nx} * ny * nz;
  std::filesystem::resize_file(path, static_cast<std::uintmax_t>(kHeaderBytes + pixels));
}

// Writes the files of a public series: the entries of tilt.com and newst.com are those of
// tests/data/convert/imod_1 in the repository uermel/cryoet-alignment, whose transforms turn the
// views by 100° and whose 59 angles are 2° apart. The images are not public.
void write_public_pair(const ScratchDirectory& folder) {
  const std::string name = "mka2018-10-01-1";
  folder.write("newst.com",
               "$setenv IMOD_OUTPUT_FORMAT MRC\n$newstack -StandardInput\nAntialiasFilter\t-1\n"
               "InputFile\t" +
                   name + ".mrc\nOutputFile\t" + name + "_ali.mrc\nTransformFile\t" + name +
                   ".xf\nTaperAtFill\t1,1\nAdjustOrigin\nSizeToOutputInXandY\t928,958\n"
                   "OffsetsInXandY\t0.0,0.0\n#DistortionField\t.idf\nImagesAreBinned\t1.0\n"
                   "BinByFactor\t4\n#GradientFile\t" +
                   name + ".maggrad\n$if (-e ./savework) ./savework\n");
  folder.write("tilt.com",
               "$setenv IMOD_OUTPUT_FORMAT MRC\n$tilt -StandardInput\nInputProjections " + name +
                   "_ali.mrc\nOutputFile " + name + "_full_rec.mrc\nIMAGEBINNED 4\nTILTFILE " +
                   name + ".tlt\nXTILTFILE " + name +
                   ".xtilt\nTHICKNESS 2000\n"
                   "RADIAL 0.35 0.035\nFalloffIsTrueSigma 1\nXAXISTILT 0.0\nLOG 0.0\n"
                   "SCALE 0.0 330.0\nPERPENDICULAR\nMODE 1\nFULLIMAGE 3708 3832\nSUBSETSTART -2 0\n"
                   "AdjustOrigin\nOFFSET 0.0\nSHIFT 0.0 0.0\nActionIfGPUFails 1,2\n"
                   "$if (-e ./savework) ./savework\n");
  std::string angles, transforms;
  for (int view = 0; view < 59; ++view) {
    angles += fmt::format("{:.2f}\n", -52.24 + 2 * view);
    transforms += view % 2 == 0 ? "-0.1813379 -0.9834202 0.9834202 -0.1813379 -58.170 69.816\n"
                                : "-0.1653824 -0.9862289 0.9862289 -0.1653824 213.511 -120.539\n";
  }
  folder.write(name + ".tlt", angles);
  folder.write(name + ".xf", transforms);
}

TEST(ImodProject, PublicSeriesOfEtomo) {
  const ScratchDirectory folder;
  write_public_pair(folder);
  // The views are wider than high before they are turned: tilt.com has 3708 × 3832 pixels.
  write_empty_stack(folder / "mka2018-10-01-1.mrc", 3832, 3708, 59);
  const auto read = [&](const std::vector<std::string>& ignored) {
    return read_project({.path = folder.path(), .ignored = ignored});
  };
  expect_parts(message_of<Error>([&] { read({}); }),
               {"tilt.com', line 7", "XTILTFILE", "mka2018-10-01-1.xtilt", "--ignore XTILTFILE"});
  std::string x_tilts;
  for (int view = 0; view < 59; ++view) x_tilts += "0.41\n";
  folder.write("mka2018-10-01-1.xtilt", x_tilts);
  const Project project = *read({});
  Values values;
  for (const auto& setting : project.settings()) values[setting.option] = setting.value;
  const auto in = [&](const char* end) {
    return (folder / (std::string("mka2018-10-01-1") + end)).string();
  };
  // The aligned stack is 4 unbinned pixels wider than the views, 2 on each side, as SUBSETSTART
  // says: the volume ends with the views, and the tilt axis stays in their middle.
  EXPECT_EQ(values, (Values{{"stack", in(".mrc")},
                            {"--xf", in(".xf")},
                            {"--tlt", in(".tlt")},
                            {"--xtilt", in(".xtilt")},
                            {"--bin", "4"},
                            {"--thickness", "2000"},
                            {"--log", "true"}}));
  EXPECT_EQ(project.warnings(), std::vector<std::string>{});
}

TEST(ImodProject, TheLogarithmNeedsANumberOrASlash) {
  const ImodFolder imod;
  imod.write_tilt("THICKNESS 900\nLOG /\n");
  EXPECT_EQ(imod.values().at("--log"), "true");
  imod.write_tilt("THICKNESS 900\nLOG\n");
  expect_parts(imod.refusal(), {"tilt.com", "LOG", "value"});
}

TEST(ImodProject, WhatStandsBehindACommandIsRefused) {
  const ImodFolder imod;
  imod.folder.write("tilt.com", "$tilt -XAXISTILT 3 -StandardInput\nInputProjections TS_ali.mrc\n");
  expect_parts(imod.refusal(), {"tilt.com", "line 1", "-XAXISTILT"});
  imod.write_tilt("THICKNESS 900\nSLICE 4 20 4\n");
  expect_parts(imod.warnings(), {"SLICE", "steps of 4"});
}

}  // namespace
}  // namespace tomofield::projects
