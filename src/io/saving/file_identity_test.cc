#include "io/saving/file_identity.h"

#include <gtest/gtest.h>

#include "scratch_directory.h"

namespace tomofield::io {
namespace {

namespace fs = std::filesystem;

TEST(FileIdentity, IsTheSameForEverySpellingOfAFile) {
  const testing::ScratchDirectory directory;
  const fs::path folder = directory / "folder", file = folder / "file";
  fs::create_directory(folder);
  fs::create_directory_symlink(folder, directory / "link");
  fs::create_symlink("file", folder / "other");  // to a file that does not exist yet
  const auto expect_same = [&] {
    for (const fs::path& spelling :
         {folder / "." / "file", folder / ".." / "folder" / "file", directory / "link" / "file",
          folder / "other", directory / "link" / "other"})
      EXPECT_EQ(identity_of(spelling), identity_of(file)) << spelling;
    EXPECT_NE(identity_of(folder / "file2"), identity_of(file));
    EXPECT_NE(identity_of(directory / "file"), identity_of(file));
  };
  expect_same();
  directory.write("folder/file", "there now");
  expect_same();
  fs::create_hard_link(file, directory / "hard");
  EXPECT_EQ(identity_of(directory / "hard"), identity_of(file));
}

TEST(FileIdentity, OfAFileInAFolderThatIsNotThereIsThatOfItsPath) {
  const testing::ScratchDirectory directory;
  EXPECT_EQ(identity_of(directory / "none" / "file"),
            identity_of(directory / "none" / ".." / "none" / "file"));
  EXPECT_NE(identity_of(directory / "none" / "file"), identity_of(directory / "none" / "file2"));
}

}  // namespace
}  // namespace tomofield::io
