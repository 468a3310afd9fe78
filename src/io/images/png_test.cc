#include "io/images/png.h"

#include <gtest/gtest.h>

#include <vector>

#include "python_script.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

TEST(Png, OtherProgramsSeeThePicture) {
  if (!testing::python_has("skimage.io")) GTEST_SKIP() << "python3-skimage is not installed";
  const testing::ScratchDirectory scratch;
  std::vector<std::uint8_t> grey{0, 50, 100, 150, 200, 255};
  write_png_grey(scratch / "grey.png", 3, 2, grey);
  std::vector<std::uint8_t> colours{255, 0, 0, 0, 255, 0, 0, 0, 255, 1, 2, 3};
  write_png_rgb(scratch / "rgb.png", 2, 2, colours);
  EXPECT_EQ(testing::run_python(scratch, R"(
import skimage.io
assert skimage.io.imread('grey.png').tolist() == [[0, 50, 100], [150, 200, 255]]
assert skimage.io.imread('rgb.png').tolist() == [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [1, 2, 3]]]
)"),
            "");
}

TEST(Png, NeedsADirectory) {
  const testing::ScratchDirectory scratch;
  EXPECT_THROW(write_png_grey(scratch / "absent/grey.png", 1, 1, std::vector<std::uint8_t>{0}),
               Error);
}

}  // namespace
}  // namespace tomofield::io
