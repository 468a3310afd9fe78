#include "io/tables/command_file.h"

#include <gtest/gtest.h>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::message_of;
using testing::ScratchDirectory;

TEST(CommandFile, HasCommandsWithTheirEntries) {
  const ScratchDirectory scratch;
  const auto path = scratch.write(
      "tilt.com",
      "# THICKNESS 7\r\nTITLE before any command\r\n$setenv IMOD_OUTPUT_FORMAT MRC\r\n"
      "$/opt/imod/bin/tilt -StandardInput\r\nTHICKNESS\t1200\r\n\r\n#LOG 0\r\nPERPENDICULAR\r\n"
      "EXCLUDELIST2   1-3, 40\r\n$if (-e ./savework) ./savework\r\n");
  const auto commands = read_command_file(path);
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(commands[0].program, "setenv");
  EXPECT_EQ(commands[2].program, "if");
  const Command& tilt = commands[1];
  EXPECT_EQ(tilt.program, "tilt");
  EXPECT_EQ(tilt.arguments, "-StandardInput");
  EXPECT_EQ(tilt.line, 4);
  ASSERT_EQ(tilt.entries.size(), 3u);
  EXPECT_EQ(tilt.entries[0].name, "THICKNESS");
  EXPECT_EQ(tilt.entries[0].value, "1200");
  EXPECT_EQ(tilt.entries[0].line, 5);
  EXPECT_EQ(tilt.entries[1].name, "PERPENDICULAR");
  EXPECT_EQ(tilt.entries[1].value, "");
  EXPECT_EQ(tilt.entries[2].value, "1-3, 40");
}

TEST(CommandFile, RefusesFilesWithoutCommands) {
  const ScratchDirectory scratch;
  for (const std::string text : {"", "THICKNESS 4\n", "# $tilt\n"}) {
    const auto path = scratch.write("a.com", text);
    EXPECT_NE(message_of<Error>([&] { read_command_file(path); }).find("a.com"), std::string::npos);
  }
  EXPECT_EQ(read_command_file(scratch.write("b.com", "$\n$ \n"))[1].program, "");
}

}  // namespace
}  // namespace tomofield::io
