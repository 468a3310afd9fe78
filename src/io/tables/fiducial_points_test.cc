#include "io/tables/fiducial_points.h"

#include <gtest/gtest.h>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::message_of;
using testing::ScratchDirectory;

TEST(FiducialPoints, ThreeFourAndFiveColumnsAreRead) {
  const ScratchDirectory scratch;
  for (const char* text : {"  10.50   20.25   0.00\n 11 21 1\n", "1 10.50 20.25 0\n\n 1 11 21 1\n",
                           "1 2 10.5 20.25 0\r\n1 2 11 21 1\r\n"}) {
    const auto points = read_fiducial_points(scratch.write("f.txt", text));
    ASSERT_EQ(points.size(), 2u) << text;
    EXPECT_EQ(points[0].x_px, 10.5);
    EXPECT_EQ(points[0].y_px, 20.25);
    EXPECT_EQ(points[0].section, 0.0);
    EXPECT_EQ(points[1].x_px, 11);
    EXPECT_EQ(points[1].section, 1);
  }
}

TEST(FiducialPoints, FaultyLinesAreNamed) {
  const ScratchDirectory scratch;
  struct Case {
    const char *text, *what, *line;
  };
  for (const Case& c :
       {Case{"1 2 3\n4 5\n", "2 columns", "line 2"}, Case{"1 2 3 4 5 6\n", "6 columns", "line 1"},
        Case{"1 2 3\n\n1 1 2 3\n", "have 3", "line 3"}, Case{"1 x 3\n", "'x'", "line 1"},
        Case{"1 nan 3\n", "'nan'", "line 1"}, Case{"1 1e300 3\n", "'1e300'", "line 1"},
        Case{"1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27\n", "…",
             "line 1"},
        Case{"10 20 5 0.3\n9 24 12 0.4\n", "another order", "line 2"},
        Case{"20 30 10 0.93\n40 20 5 0.8\n", "scores", "last column"},
        Case{"", "no fiducial", "f.txt"}}) {
    const auto path = scratch.write("f.txt", c.text);
    const std::string message = message_of<Error>([&] { read_fiducial_points(path); });
    for (const char* part : {c.what, c.line, "f.txt"}) {
      EXPECT_NE(message.find(part), std::string::npos) << part << " in: " << message;
    }
  }
}

}  // namespace
}  // namespace tomofield::io
