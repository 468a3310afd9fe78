#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "expect_parts.h"
#include "io/tables/alignment_files.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

TEST(Mdoc, ReadsSectionsInAnyOrder) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.mdoc", R"(PixelSpacing = 2.17
ImageFile = a.st

[T = SerialEM: Tilt axis angle = 85.9, binning = 1]

[ZValue = 1]
ExposureDose = 3
TiltAngle = 3.001
SomeNewKey = what=ever

[ZValue = 0]
TiltAngle = -0.002
RotationAngle = 175.9
)");
  const Mdoc mdoc = read_mdoc(path);
  EXPECT_EQ(mdoc.pixel_spacing_A, 2.17);
  ASSERT_EQ(mdoc.sections.size(), 2u);
  EXPECT_EQ(mdoc.sections[0].section, 0);
  EXPECT_EQ(mdoc.sections[0].tilt_deg, -0.002);
  EXPECT_EQ(mdoc.sections[1].tilt_deg, 3.001);
  EXPECT_EQ(mdoc.sections[1].line, 8);
}

TEST(Mdoc, RefusesWhatContradictsItself) {
  const ScratchDirectory scratch;
  expect_parts(message_of<Error>(
                   [&] { read_mdoc(scratch.write("a.mdoc", "[ZValue = 0]\nTiltAngle = up\n")); }),
               {"a.mdoc", "line 2", "TiltAngle = up"});
  expect_parts(message_of<Error>(
                   [&] { read_mdoc(scratch.write("a.mdoc", "[ZValue = 0]\n[ZValue = 0]\n")); }),
               {"a.mdoc", "line 2", "twice"});
  for (const char* bad : {"[ZValue = first]\n", "[ZValue = 0]\nTiltAngle = nan\n",
                          "[ZValue = 0]\nTiltAngle = 1e300\n", "PixelSpacing = inf\n[ZValue = 0]\n",
                          "[ZValue = 9999999999999]\n"})
    EXPECT_THROW(read_mdoc(scratch.write("a.mdoc", bad)), Error) << bad;
}

TEST(Mdoc, AxisComesFromTheTitleAndNeverFromRotationAngle) {
  const ScratchDirectory scratch;
  const auto axis = [&](const std::string& text) {
    return read_mdoc(scratch.write("a.mdoc", text + "\n[ZValue = 0]\nRotationAngle = 175\n"))
        .tilt_axis_deg;
  };
  const std::string title = "[T =     Tilt axis angle = -94.8, binning = 1  spot = 8  camera = 0]";
  EXPECT_EQ(axis(title)->value, -94.8);
  EXPECT_EQ(axis("TiltAxisAngle = 176.5\n" + title)->value, -94.8);
  EXPECT_EQ(axis("TiltAxisAngle = 176.5\n" + title)->line, 2);
  EXPECT_EQ(axis(title + "\nTiltAxisAngle = 176.5")->value, -94.8);
  EXPECT_EQ(axis("TiltAxisAngle = 176.5")->value, 176.5);
  const auto differences = [&](const std::string& text) {
    return read_mdoc(scratch.write("a.mdoc", text + "\n[ZValue = 0]\n")).differences;
  };
  ASSERT_EQ(differences("TiltAxisAngle = 176.5\n" + title).size(), 1u);
  expect_parts(differences("TiltAxisAngle = 176.5\n" + title)[0],
               {"-94.8° in line 2, which is taken", "176.5° in line 1", "--tilt-axis"});
  EXPECT_TRUE(differences("TiltAxisAngle = -94.6\n" + title).empty());
  EXPECT_EQ(axis("[T = SerialEM: Digitized on EMBL Krios]"), std::nullopt);
  expect_parts(message_of<Error>([&] { axis("[T = Tilt axis angle = steep, binning = 1]"); }),
               {"a.mdoc", "line 1", "steep"});
}

std::vector<std::size_t> order_of(const std::vector<std::string>& entries) {
  const ScratchDirectory scratch;
  std::string text;
  for (std::size_t i = 0; i < entries.size(); ++i)
    text += "[ZValue = " + std::to_string(i) + "]\n" + entries[i] + "\n";
  return acquisition_order(read_mdoc(scratch.write("a.mdoc", text))).sections;
}

TEST(Mdoc, OrderIsByTimeElseByDoseElseByNumber) {
  using Order = std::vector<std::size_t>;
  EXPECT_EQ(order_of({"DateTime = 01-Mar-21  00:00:03\nPriorRecordDose = 0",
                      "DateTime = 28-Feb-21  23:59:59\nPriorRecordDose = 6",
                      "DateTime = 01-Mar-21  00:00:01\nPriorRecordDose = 3"}),
            (Order{1, 2, 0}));
  EXPECT_EQ(order_of({"DateTime = 01-Mar-24 00:00:03", "DateTime = 29-Feb-2024 23:59:59"}),
            (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(order_of({"DateTime = 2024-03-01 00:00:03", "DateTime = 2024-02-29 23:59:59"}),
            (Order{1, 0}));
  // One of the times is none, or two are the same.
  EXPECT_EQ(order_of({"DateTime = 31-Feb-21 00:00:01\nPriorRecordDose = 3",
                      "DateTime = 01-Feb-21 00:00:01\nPriorRecordDose = 0"}),
            (Order{1, 0}));
  EXPECT_EQ(order_of({"DateTime = 01-Feb-21 00:00:01\nPriorRecordDose = 3",
                      "DateTime = 01-Feb-21 00:00:01\nPriorRecordDose = 0"}),
            (Order{1, 0}));
  EXPECT_EQ(order_of({"PriorRecordDose = 0", "PriorRecordDose = 0"}), (Order{0, 1}));
  EXPECT_EQ(order_of({"PriorRecordDose = 5", ""}), (Order{0, 1}));
}

TEST(Mdoc, FilesAreNamedWithoutTheirFolders) {
  const ScratchDirectory scratch;
  const Mdoc mdoc = read_mdoc(scratch.write(
      "a.mdoc",
      "ImageFile = D:\\data\\a.st\n[ZValue = 0]\nSubFramePath = X:\\fr ames\\a_1.eer\n"
      "[ZValue = 1]\nSubFramePath = /mnt/a_2.tif\n"));
  EXPECT_EQ(mdoc.image_file, "a.st");
  EXPECT_EQ(mdoc.sections[0].frame_name, "a_1.eer");
  EXPECT_EQ(mdoc.sections[1].frame_name, "a_2.tif");
}

TEST(Mdoc, SectionsThatStateTwoAxesAreRefused) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& key, const char* first, const char* second) {
    return read_mdoc(scratch.write(
        "a.mdoc", fmt::format("[ZValue = 0]\n{0} = {1}\n[ZValue = 1]\n{0} = {2}\n[ZValue = 2]\n"
                              "{0} = {2}\n",
                              key, first, second)));
  };
  EXPECT_EQ(read("TiltAxisAngle", "85", "85.4").tilt_axis_deg->value, 85.0);
  EXPECT_EQ(read("RotationAngle", "0", "175").lone_rotation_deg->value, 175.0);  // 0: no angle
  for (const char* key : {"TiltAxisAngle", "RotationAngle"})
    expect_parts(message_of<Error>([&] { read(key, "20", "85"); }),
                 {"a.mdoc", "line 4", key, "85", "20", "line 2"});
  expect_parts(message_of<Error>([&] { read("TiltAxisAngle", "0", "85"); }), {"line 4", "line 2"});
}

TEST(Mdoc, NotesTwoMagnifications) {
  const ScratchDirectory scratch;
  for (const char* key : {"Magnification", "Binning"}) {
    const auto differences = [&](const char* second) {
      return read_mdoc(scratch.write("a.mdoc", fmt::format("[ZValue = 0]\n{0} = 2\n[ZValue = 1]\n"
                                                           "{0} = {1}\n[ZValue = 2]\n{0} = {1}\n",
                                                           key, second)))
          .differences;
    };
    EXPECT_TRUE(differences("2").empty());
    EXPECT_TRUE(differences("0").empty());  // not known
    ASSERT_EQ(differences("4").size(), 1u);
    expect_parts(differences("4")[0], {key, "= 2 in line 2, and 4 in line 4", "--exclude"});
  }
}

TEST(Mdoc, ReadsTheAxisOfTomographyByRotationAngle) {
  const ScratchDirectory scratch;
  const auto read = [&](const char* axis, const std::string& rotation) {
    return read_mdoc(scratch.write("a.mdoc", fmt::format("[T =   TiltAxisAngle = {}  Binning = 1  "
                                                         "SpotSize = 6]\n[ZValue = 0]\n{}\n",
                                                         axis, rotation)));
  };
  // The three relations of IMOD's header.f90.
  EXPECT_EQ(read("-176.20", "RotationAngle = 86.20").tilt_axis_deg->value, 86.2);
  EXPECT_EQ(read("86.2", "RotationAngle = 176.2").tilt_axis_deg->value, 86.2);
  EXPECT_EQ(read("-86.2", "RotationAngle = 176.2").tilt_axis_deg->value, 86.2);
  for (const char* rotation : {"", "RotationAngle = 20"}) {
    const Mdoc unclear = read("-176.20", rotation);
    EXPECT_FALSE(unclear.tilt_axis_deg);
    EXPECT_EQ(unclear.unclear_axis_deg->value, -176.2);
    EXPECT_EQ(unclear.unclear_axis_deg->line, 1);
  }
}

TEST(Mdoc, ReadsTheMicroscope) {
  const ScratchDirectory scratch;
  const Mdoc mdoc = read_mdoc(
      scratch.write("a.mdoc",
                    "\xEF\xBB\xBFPixelSpacing = 5.4\r\nVoltage = 200\r\nImageSize = 1440 1023\r\n"
                    "[ZValue = 0]\r\nTiltAngle = 3\r\n"));
  EXPECT_EQ(mdoc.pixel_spacing_A, 5.4);
  EXPECT_EQ(mdoc.voltage_kV, 200.0);
  EXPECT_EQ(*mdoc.image_size_px, (std::array<std::int64_t, 2>{1440, 1023}));
  EXPECT_EQ(mdoc.sections[0].tilt_deg, 3.0);
  EXPECT_FALSE(read_mdoc(scratch.write("a.mdoc", "Voltage = 0\n[ZValue = 0]\n")).voltage_kV);
}

TEST(Mdoc, RefusesAPixelSizeThatCannotBe) {
  const ScratchDirectory scratch;
  const auto read = [&](const std::string& size) {
    return read_mdoc(scratch.write("a.mdoc", "[ZValue = 0]\nPixelSpacing = " + size + "\n"));
  };
  EXPECT_EQ(read("0").pixel_spacing_A, 0.0);  // not known
  for (const char* bad : {"-10", "1e-30", "1e8"})
    expect_parts(message_of<Error>([&] { read(bad); }), {"a.mdoc", "line 2", "PixelSpacing"});
}

TEST(Mdoc, ReadsTheDefocusThatTheSessionAimedAt) {
  const ScratchDirectory scratch;
  const auto target_um = [&](const char* text) {
    return target_underfocus_um(read_mdoc(scratch.write("a.mdoc", text)));
  };
  EXPECT_EQ(target_um("[ZValue = 0]\nTargetDefocus = -3\n[ZValue = 1]\n"
                      "[ZValue = 2]\nTargetDefocus = -3\n[ZValue = 3]\nTargetDefocus = -5\n"),
            3.0);
  for (const char* none :
       {"[ZValue = 0]\nDefocus = -3\n", "[ZValue = 0]\nTargetDefocus = 0\n",
        "[ZValue = 0]\nTargetDefocus = 2\n", "[ZValue = 0]\nTargetDefocus = nan\n"})
    EXPECT_FALSE(target_um(none)) << none;
  expect_parts(message_of<Error>([&] { target_um("[ZValue = 0]\nTargetDefocus = -3000\n"); }),
               {"a.mdoc", "line 2", "TargetDefocus", "-3000"});
  expect_parts(message_of<Error>([&] { target_um("[ZValue = 0]\nTargetDefocus = low\n"); }),
               {"a.mdoc", "line 2", "TargetDefocus", "low"});
}

TEST(Mdoc, LinesBelowAHeadOfAnotherKindAreNotOfTheSectionBefore) {
  const ScratchDirectory scratch;
  const Mdoc mdoc = read_mdoc(
      scratch.write("a.mdoc",
                    "[ZValue = 0]\nTiltAngle = -20\n[T = a title]\nExposureDose = 3\n"
                    "[FrameSet = 0]\nTiltAngle = 7\nVoltage = 200\nPixelSpacing = 2\n[ZValue = 1]\n"
                    "TiltAngle = 4\n[MontSection = 0]\nTiltAngle = 9\n"));
  ASSERT_EQ(mdoc.sections.size(), 2u);
  EXPECT_EQ(mdoc.sections[0].tilt_deg, -20.0);
  EXPECT_EQ(mdoc.sections[0].dose, 3.0);
  EXPECT_EQ(mdoc.sections[1].tilt_deg, 4.0);
  EXPECT_FALSE(mdoc.voltage_kV || mdoc.pixel_spacing_A);
}

TEST(Mdoc, EntriesThatContradictEachOtherAreRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    return message_of<Error>([&] { read_mdoc(scratch.write("a.mdoc", text)); });
  };
  const std::string second = "[ZValue = 1]\nTiltAngle = 2\n";
  EXPECT_EQ(refusal("Voltage = 300\n[ZValue = 0]\nTiltAngle = 1\nTiltAngle = 1\nVoltage = 300\n"),
            "");
  expect_parts(refusal("[ZValue = 0]\nTiltAngle = 1\nTiltAngle = 2\n"),
               {"a.mdoc", "line 3", "TiltAngle", "twice"});
  expect_parts(refusal("Voltage = 300\n[ZValue = 0]\nTiltAngle = 1\nVoltage = 200\n"),
               {"a.mdoc", "line 4", "Voltage", "200", "300"});
  expect_parts(refusal("[T = Tilt axis angle = 85.3, binning = 1]\n"
                       "[T = Tilt axis angle = 0.2, binning = 1]\n[ZValue = 0]\n"),
               {"a.mdoc", "line 2", "0.2", "85.3", "line 1"});
  expect_parts(
      refusal("PixelSpacing = 10\n[ZValue = 0]\nTiltAngle = 1\n" + second + "PixelSpacing = 20\n"),
      {"a.mdoc", "line 6", "PixelSpacing", "20", "10"});
}

TEST(Mdoc, TheSizeOfImagesIsReadOrNoted) {
  const ScratchDirectory scratch;
  const auto with_head = [&](const std::string& head) {
    return read_mdoc(scratch.write("a.mdoc", head + "\n[ZValue = 0]\nTiltAngle = 1\n"));
  };
  for (const char* size : {"96 48", "96.0 48.0"}) {
    const Mdoc mdoc = with_head(std::string("ImageSize = ") + size);
    EXPECT_EQ(mdoc.image_size_px, (std::array<std::int64_t, 2>{96, 48}));
    EXPECT_TRUE(mdoc.differences.empty());
  }
  for (const char* size : {"96x48", "96 48 16", "96.5 48", "0 48"}) {
    const Mdoc mdoc = with_head(std::string("ImageSize = ") + size);
    ASSERT_EQ(mdoc.differences.size(), 1u) << size;
    expect_parts(mdoc.differences[0], {"ImageSize", size, "line 1", "--pixel-size"});
  }
  expect_parts(message_of<Error>([&] { with_head("ImageSize = 96 96\nImageSize = 48 48"); }),
               {"a.mdoc", "line 2", "ImageSize", "twice"});
}

TEST(Mdoc, NotesARotationAngleThatContradictsTheTitle) {
  const ScratchDirectory scratch;
  const auto differences = [&](const std::string& axis, const std::string& rotation) {
    return read_mdoc(scratch.write("a.mdoc", "[T = Tilt axis angle = " + axis +
                                                 ", binning = 1]\n[ZValue = 0]\nTiltAngle = 1\n"
                                                 "RotationAngle = 175\n[ZValue = 1]\n"
                                                 "TiltAngle = 4\nRotationAngle = " +
                                                 rotation + "\n"))
        .differences;
  };
  EXPECT_TRUE(differences("85.3", "175").empty());
  EXPECT_TRUE(differences("-95.2", "175.4").empty());
  for (const auto& [axis, rotation] : {std::pair("0.0", "175"), {"85.3", "30"}}) {
    const auto found = differences(axis, rotation);
    ASSERT_EQ(found.size(), 1u) << axis;
    expect_parts(found[0], {"line 1", "RotationAngle", "--tilt-axis"});
  }
}

TEST(Mdoc, EntriesWithoutAValueStateNothing) {
  const ScratchDirectory scratch;
  const Mdoc mdoc = read_mdoc(scratch.write("a.mdoc",
                                            "Voltage =\n[ZValue = 0]\nTiltAngle = 3\nExposureDose "
                                            "=\nPriorRecordDose = \nPixelSpacing ="));
  EXPECT_EQ(mdoc.sections[0].tilt_deg, 3.0);
  EXPECT_FALSE(mdoc.sections[0].dose || mdoc.sections[0].prior_dose || mdoc.voltage_kV ||
               mdoc.pixel_spacing_A);
}

TEST(Mdoc, ATitleOfTwoDirectionsLeavesSortedSectionsWithoutAnOrder) {
  const ScratchDirectory scratch;
  const auto fault = [&](const std::string& title, const std::string& last) {
    return acquisition_order(read_mdoc(scratch.write(
                                 "a.mdoc", title +
                                               "\n[ZValue = 0]\nTiltAngle = -10\n[ZValue = 1]\n"
                                               "TiltAngle = 0\n[ZValue = 2]\nTiltAngle = " +
                                               last)))
        .fault_of_times;
  };
  const std::string title = "[T = Tilt axis angle = 85.3, binning = 1  spot = 8  camera = 0";
  EXPECT_EQ(fault(title + "]", "10"), "");
  for (const char* scheme : {"  bidir = 0.0]", "  dosym = 0.0]"}) {
    expect_parts(fault(title + scheme, "10"), {"line 1", "two directions", "DateTime"});
    EXPECT_EQ(fault(title + scheme, "-20"), "");  // in the order of recording
  }
}

TEST(Mdoc, MontagesAreRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    return message_of<Error>([&] { read_mdoc(scratch.write("a.mdoc", text)); });
  };
  const std::string pieces =
      "[ZValue = 0]\nTiltAngle = 1\nPieceCoordinates = 0 0 0\n[ZValue = 1]\n"
      "TiltAngle = 1\nPieceCoordinates = ";
  EXPECT_EQ(refusal("Montage = 0\n" + pieces + "0 0 1\n"), "");
  expect_parts(refusal(pieces + "900 0 0\n"), {"a.mdoc", "[ZValue = 1]", "montage"});
  const std::string two = "[ZValue = 0]\nTiltAngle = 1\n[ZValue = 1]\nTiltAngle = ";
  expect_parts(refusal("Montage = 1\n" + two + "1\n"), {"a.mdoc", "Montage", "[ZValue = 1]"});
  EXPECT_EQ(refusal("Montage = 1\n" + two + "4\n"), "");  // one piece a view
}

}  // namespace
}  // namespace tomofield::io
