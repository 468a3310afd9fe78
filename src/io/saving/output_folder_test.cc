#include "io/saving/output_folder.h"

#include <gtest/gtest.h>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;
using testing::ScratchDirectory;

TEST(OutputFolder, LeavesNoEmptyFolderThatItMade) {
  const ScratchDirectory scratch;
  fs::create_directory(scratch / "there");
  {
    const OutputFolder made(scratch / "there/new/folder/");
    EXPECT_TRUE(fs::is_directory(scratch / "there/new/folder"));
  }
  EXPECT_TRUE(fs::is_empty(scratch / "there"));
  { const OutputFolder there(scratch / "there"); }
  EXPECT_TRUE(fs::is_directory(scratch / "there"));
}

TEST(OutputFolder, KeepsWhatHasResults) {
  const ScratchDirectory scratch;
  {
    const OutputFolder made(scratch / "new/folder");
    scratch.write("new/folder/result.txt", "text");
  }
  EXPECT_TRUE(fs::exists(scratch / "new/folder/result.txt"));
}

TEST(OutputFolder, RefusesWhatIsNoFolder) {
  const ScratchDirectory scratch;
  const auto file = scratch.write("file", "text");
  EXPECT_THROW(OutputFolder{file}, Error);
  EXPECT_THROW(OutputFolder{file / "folder"}, Error);
}

TEST(ScratchFolder, LeavesNothing) {
  const ScratchDirectory scratch;
  scratch.write(".plans/.plan.json.tomofield-lock", "of a killed command");
  {
    const ScratchFolder made(scratch.path(), ".plans");
    EXPECT_TRUE(fs::is_empty(scratch / ".plans"));
    scratch.write(".plans/plan.json", "{}");
    scratch.write(".plans/log", "text");
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(ScratchFolder, KeepsFilesOfOthers) {
  const ScratchDirectory scratch;
  {
    const ScratchFolder made(scratch.path(), ".plans");
    scratch.write(".plans/notes.txt", "text");
  }
  EXPECT_TRUE(fs::exists(scratch / ".plans/notes.txt"));
  EXPECT_THROW(ScratchFolder(scratch.path(), ".plans"), Error);
  EXPECT_TRUE(fs::exists(scratch / ".plans/notes.txt"));
  scratch.write(".file", "text");
  EXPECT_THROW(ScratchFolder(scratch.path(), ".file"), Error);
}

}  // namespace
}  // namespace tomofield::io
