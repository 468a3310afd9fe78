#include "io/saving/atomic_folder.h"

#include <gtest/gtest.h>

#include <fstream>

#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;
using testing::message_of;
using testing::read_whole_file;
using testing::ScratchDirectory;

// Makes a folder of results with one file beside the marker.
AtomicFolder folder_with(const fs::path& path, const std::string& text) {
  AtomicFolder folder(path, "marker");
  std::ofstream(folder.temporary_path() / "marker") << "";
  fs::create_directories(folder.temporary_path() / "deep/er");
  std::ofstream(folder.temporary_path() / "deep/er/text") << text;
  return folder;
}

std::string text_in(const fs::path& folder) { return read_whole_file(folder / "deep/er/text"); }

TEST(AtomicFolder, AppearsAsAWhole) {
  const ScratchDirectory scratch;
  for (const std::string text : {"first", "second"}) {
    AtomicFolder folder = folder_with(scratch / "a", text);
    EXPECT_EQ(fs::exists(scratch / "a"), text == "second");
    folder.commit();
    EXPECT_EQ(text_in(scratch / "a"), text);
    EXPECT_EQ(scratch.num_files(), 1u);
  }
}

TEST(AtomicFolder, LeavesNothingWithoutCommit) {
  const ScratchDirectory scratch;
  folder_with(scratch / "a", "kept").commit();
  { const AtomicFolder folder = folder_with(scratch / "a", "lost"); }
  EXPECT_EQ(text_in(scratch / "a"), "kept");
  EXPECT_EQ(scratch.num_files(), 1u);
}

TEST(AtomicFolder, ReplacesNoFolderOfAnotherKind) {
  const ScratchDirectory scratch;
  fs::create_directories(scratch / "mine");
  scratch.write("file", "");
  for (const char* name : {"mine", "file"}) {
    const auto said = message_of<Error>([&] { AtomicFolder(scratch / name, "marker"); });
    EXPECT_NE(said.find(name), std::string::npos);
  }
  EXPECT_EQ(scratch.num_files(), 2u);
}

TEST(AtomicFolder, JoinsASetOfResults) {
  const ScratchDirectory scratch;
  folder_with(scratch / "a", "old").commit();
  {
    OutputSet set;
    folder_with(scratch / "a", "new").commit();
    write_text_file(scratch / "b", "text");
    EXPECT_EQ(text_in(scratch / "a"), "old");
    EXPECT_FALSE(fs::exists(scratch / "b"));
  }
  EXPECT_EQ(text_in(scratch / "a"), "old");
  EXPECT_EQ(scratch.num_files(), 1u);
  OutputSet set;
  folder_with(scratch / "a", "new").commit();
  write_text_file(scratch / "b", "text");
  set.commit();
  EXPECT_EQ(text_in(scratch / "a"), "new");
  EXPECT_EQ(read_whole_file(scratch / "b"), "text");
  EXPECT_EQ(scratch.num_files(), 2u);
}

TEST(AtomicFolder, GivesBackTheOldOneIfAnotherResultFails) {
  const ScratchDirectory scratch;
  folder_with(scratch / "a", "old").commit();
  folder_with(scratch / "b", "old").commit();
  OutputSet set;
  folder_with(scratch / "a", "new").commit();
  AtomicFolder second = folder_with(scratch / "b", "new");
  fs::remove_all(second.temporary_path());  // cannot get its name
  second.commit();
  EXPECT_THROW(set.commit(), Error);
  EXPECT_EQ(text_in(scratch / "a"), "old");
  EXPECT_EQ(text_in(scratch / "b"), "old");
}

}  // namespace
}  // namespace tomofield::io
