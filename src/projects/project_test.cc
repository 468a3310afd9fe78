#include "projects/project.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <string>

#include "expect_parts.h"
#include "imod_folder.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::projects {
namespace {

using testing::expect_parts;
using testing::ImodFolder;
using testing::message_of;
using testing::ScratchDirectory;
using testing::some_value;
using testing::write_stack;

TEST(ProjectFolder, HasOneProject) {
  const ImodFolder imod;
  const auto find = [&] {
    return message_of<Error>([&] { read_project({.path = imod.folder.path()}); });
  };
  expect_parts(find(), {"no project", "tilt.com", ".aln"});
  imod.write_tilt("");
  imod.folder.write("TS.st.mdoc", "[ZValue = 0]\n");  // metadata, beside a project
  EXPECT_EQ(find(), "");
  for (const char* axis : {"tilta.com", "tiltb.com"})
    std::filesystem::copy_file(imod.folder / "tilt.com", imod.folder / axis);
  std::filesystem::remove(imod.folder / "tilt.com");
  expect_parts(find(), {"2 projects", "tilta.com, tiltb.com"});
  EXPECT_TRUE(read_project({.path = imod.folder / "tilta.com"}).has_value());
  EXPECT_FALSE(read_project({.path = imod.folder / "TS.st"}).has_value());
  EXPECT_FALSE(read_project({.path = imod.folder / "absent.com"}).has_value());
}

TEST(ProjectFolder, IsThatOfTheFileThatHoldsASeries) {
  const ScratchDirectory folder;
  write_stack(folder / "TS.mrc", 16, 12, 1, some_value);
  folder.write("TS_1.eer.mdoc", "[FrameSet = 0]\nTiltAngle = 1\n");
  const auto mdoc = folder.write("TS.mrc.mdoc", "[ZValue = 0]\nTiltAngle = 1\n");
  EXPECT_EQ(read_project({.path = folder.path()})->files().front(), mdoc);
  std::filesystem::remove(mdoc);
  folder.write("m.xml", "<Movie/>");
  const auto xml =
      folder.write("TS.xml", "<TiltSeries><Angles>0</Angles><MoviePath>" +
                                 (folder / "TS.mrc").string() + "</MoviePath></TiltSeries>");
  EXPECT_EQ(read_project({.path = folder.path()})->files().front(), xml);
}

TEST(ProjectFolder, EntriesOfWhatHasNoneCannotBeIgnored) {
  const ScratchDirectory folder;
  const auto stack = write_stack(folder / "TS.mrc", 16, 12, 1, some_value);
  const auto refusal = [&](const char* entry) {
    return message_of<Error>([&] { read_project({.path = stack, .ignored = {entry}}); });
  };
  EXPECT_EQ(refusal("TiltAxisAngle"), "");
  expect_parts(refusal("LOCALFILE"), {"--ignore LOCALFILE", "TS.mrc", "no project"});
}

TEST(ProjectFolder, OfImagesAlone) {
  const ScratchDirectory folder;
  EXPECT_FALSE(read_project({.path = folder.path(), .has_mdoc = true}));
}

TEST(AreTomoProject, ThicknessAndStack) {
  const ScratchDirectory folder;
  const auto aln =
      folder.write("TS.aln",
                   "# RawSize = 16 12 2\n# AlphaOffset = 1.5\n# BetaOffset = -0.5\n"
                   "# Thickness = 1240\n1 0 1 0 0 0 0 0 0 -10\n2 0 1 0 0 0 0 0 0 10\n");
  expect_parts(message_of<Error>([&] { read_project({.path = aln}); }),
               {"TS.aln", "TS.mrc", "--aln"});
  write_stack(folder / "TS.mrc", 16, 12, 2, some_value);
  const Project project = *read_project({.path = folder.path()});
  ASSERT_EQ(project.settings().size(), 3u);
  EXPECT_EQ(project.settings()[0].value, (folder / "TS.mrc").string());
  EXPECT_EQ(project.settings()[2].value, "1240");
  EXPECT_EQ(project.settings()[2].entry, "Thickness");
  folder.write("tomogram_align.aln", "a result of this program, which is no second project\n");
  EXPECT_TRUE(read_project({.path = folder.path()}).has_value());
  ASSERT_EQ(project.warnings().size(), 1u);  // the alignment itself warns of BetaOffset
  expect_parts(project.warnings()[0], {"AlphaOffset", "1.5"});
}

TEST(AreTomoProject, MayBeNamedAfterTheFileOfItsStack) {
  const ScratchDirectory folder;
  const auto aln = folder.write(
      "T1.st.aln", "# RawSize = 16 12 2\n1 0 1 0 0 0 0 0 0 -10\n2 0 1 0 0 0 0 0 0 10\n");
  write_stack(folder / "T1.st", 16, 12, 2, some_value);
  const auto ctf = folder.write("T1_CTF.txt", "");
  const Project project = *read_project({.path = aln});
  EXPECT_EQ(project.value_of("--ctf"), ctf.string());
}

TEST(MdocProject, SetsTheTargetOfTheDefocusWhereNothingMeasuresIt) {
  const ScratchDirectory folder;
  write_stack(folder / "TS.mrc", 16, 12, 1, some_value);
  const auto set_by = [&](const std::string& text) {
    std::string all;
    const auto mdoc = folder.write("TS.mdoc", text);
    const Project project = read_project({.path = mdoc}).value();
    for (const Setting& setting : project.settings())
      if (setting.option == "--defocus" || setting.option == "--ctf")
        all += setting.option + " " + setting.value + " " + setting.entry;
    return all;
  };
  const std::string with_pixels = "PixelSpacing = 5\n",
                    target = "[ZValue = 0]\nTiltAngle = 1\nTargetDefocus = -3.5\n";
  EXPECT_EQ(set_by(with_pixels + target), "--defocus 3.5 TargetDefocus");
  EXPECT_EQ(set_by(target), "");
  const auto warning = [&](const std::string& second) {
    const auto mdoc = folder.write(
        "TS.mdoc",
        with_pixels + target + "[ZValue = 1]\nTiltAngle = 2\nTargetDefocus = " + second + "\n");
    return fmt::format("{}", fmt::join(read_project({.path = mdoc})->warnings(), "\n"));
  };
  EXPECT_EQ(warning("-3.6"), "");
  expect_parts(warning("-9"), {"TargetDefocus", "from -9 to -3.5", "median"});
  expect_parts(warning("3"), {"TargetDefocus", "not applied"});
  folder.write("TS_ctf.txt", "1 30000 30000 0 0 0.5 5\n");
  EXPECT_EQ(set_by(with_pixels + target), "--ctf " + (folder / "TS_ctf.txt").string() + " CTF");
}

TEST(MdocProject, NamesMayHavePoints) {
  const ScratchDirectory folder;
  write_stack(folder / "lam1.2.mrc", 16, 12, 1, some_value);
  const std::string row = "1 30000 30000 0 0 0.5 5\n";
  for (const char* name : {"lam1_ctf.txt", "lam1.2_ctf.txt"}) folder.write(name, row);
  for (const char* name : {"lam1.2.mdoc", "lam1.2.mrc.mdoc"}) {
    const auto mdoc = folder.write(name, "[ZValue = 0]\nTiltAngle = 1\n");
    EXPECT_EQ(read_project({.path = mdoc})->value_of("--ctf"),
              (folder / "lam1.2_ctf.txt").string());
  }
  write_stack(folder / "TS.map", 16, 12, 1, some_value);
  folder.write("TS_ctf.txt", row);
  const auto mdoc = folder.write("TS.map.mdoc", "[ZValue = 0]\nTiltAngle = 1\n");
  EXPECT_EQ(read_project({.path = mdoc})->value_of("--ctf"), (folder / "TS_ctf.txt").string());
}

TEST(MdocProject, FindsTheStackOrTheImages) {
  const ScratchDirectory folder;
  const auto mdoc = folder.write("TS.mdoc",
                                 "ImageFile = D:\\other.st\n[ZValue = 0]\nTiltAngle = 1\n"
                                 "SubFramePath = D:\\m_1.eer\n");
  const auto stack = [&] { return read_project({.path = mdoc})->settings()[0]; };
  EXPECT_THROW(stack(), Error);
  write_stack(folder / "m_1.mrc", 16, 12, 1, some_value);
  EXPECT_EQ(stack().value, mdoc.string());
  EXPECT_EQ(stack().entry, "SubFramePath");
  write_stack(folder / "other.st", 16, 12, 1, some_value);
  EXPECT_EQ(stack().value, (folder / "other.st").string());
  write_stack(folder / "TS.mrc", 16, 12, 1, some_value);
  EXPECT_EQ(stack().value, (folder / "other.st").string());
  std::filesystem::rename(folder / "other.st", folder / "another.st");
  EXPECT_EQ(stack().value, (folder / "TS.mrc").string());
  std::filesystem::rename(folder / "another.st", folder / "other.st");
  std::filesystem::rename(mdoc, folder / "TS.mrc.mdoc");
  EXPECT_EQ(read_project({.path = folder.path()})->settings()[0].value,
            (folder / "TS.mrc").string());
}

}  // namespace
}  // namespace tomofield::projects
