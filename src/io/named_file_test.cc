#include "io/named_file.h"

#include <gtest/gtest.h>

#include <array>

#include "scratch_directory.h"

namespace tomofield::io {
namespace {

using testing::ScratchDirectory;

TEST(NamedFile, IsFoundWhereTheProjectWasMoved) {
  const ScratchDirectory scratch;
  std::filesystem::create_directories(scratch / "project/ts");
  std::filesystem::create_directories(scratch / "project/frames");
  const auto view = scratch.write("project/frames/v_01.mrc", "1");
  const std::array folders{scratch / "project/ts", scratch / "project"};
  EXPECT_EQ(find_named_file("frames/v_01.mrc", folders), view);
  EXPECT_EQ(find_named_file("/old/project/frames/v_01.mrc", folders), view);
  EXPECT_EQ(find_named_file("X:\\old\\project\\frames\\v_01.mrc", folders), view);
  EXPECT_EQ(find_named_file("\\\\server\\frames\\v_01.mrc", folders), view);
  EXPECT_EQ(find_named_file(view.string(), {}), view);
  // The longest end that is there, and never another file of a relative name.
  const auto beside = scratch.write("project/ts/v_01.mrc", "2");
  EXPECT_EQ(find_named_file("/old/frames/v_01.mrc", folders), view);
  EXPECT_EQ(find_named_file("/old/averages/v_01.mrc", folders), beside);
  EXPECT_FALSE(find_named_file("averages/v_01.mrc", folders));
  EXPECT_FALSE(find_named_file("/old/v_02.mrc", folders));
  EXPECT_FALSE(find_named_file("", folders));
  EXPECT_FALSE(find_named_file("/old/frames", folders));  // a folder
}

TEST(NamedFile, NamesWithoutFolders) {
  EXPECT_EQ(without_folders("D:\\data\\a.st"), "a.st");
  EXPECT_EQ(without_folders("/data/a.st"), "a.st");
  EXPECT_EQ(without_folders("a.st"), "a.st");
}

}  // namespace
}  // namespace tomofield::io
